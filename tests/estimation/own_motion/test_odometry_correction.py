from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from estimation.models.motion import Matrix, Vector
from estimation.own_motion import odometry_correction
from estimation.own_motion.input_alignment import UNKNOWN, Alignment, Known
from estimation.own_motion.odometry_correction import (
    NOTHING_SEEN,
    PERFECT,
    OdometryComparison,
    reconsidered,
    with_pose,
    with_sample,
)
from estimation.own_motion.odometry_history import (
    AS_TOLD,
    IDEAL,
    Correction,
    InputTrust,
    MotionSample,
    left_of,
)
from formation.pose import Pose

MS = 1_000_000
ZERO_NS = 1_700_000_000_000_000_000


def pose_stamps(stamps: list[int]) -> list[int]:
    """Stamps of the poses that are kept of these."""
    comparison = NOTHING_SEEN
    for k, stamp_ns in enumerate(stamps):
        comparison = with_pose(comparison, stamp_ns, Pose(float(k), 0.0, 0.0))
    return [stamp_ns for stamp_ns, _ in comparison.poses]


def sample_stamps(stamps: list[int]) -> list[int]:
    """The same of samples."""
    comparison = NOTHING_SEEN
    for k, stamp_ns in enumerate(stamps):
        comparison = with_sample(comparison, MotionSample(stamp_ns, float(k), 0.0))
    return [sample.stamp_ns for sample in comparison.samples]


@pytest.mark.parametrize("kept", [pose_stamps, sample_stamps])
def test_what_comes_late_or_closer_than_30_ms_is_left_out(kept: Callable[[list[int]], list[int]]) -> None:
    given = [ZERO_NS + at * MS for at in (0, 29, 30, 59, 60, 45, 10, 95)]
    assert kept(given) == [ZERO_NS + at * MS for at in (0, 30, 60, 95)]
    assert kept([ZERO_NS, ZERO_NS + 30 * MS - 1]) == [ZERO_NS]


@pytest.mark.parametrize("kept", [pose_stamps, sample_stamps])
def test_exactly_the_last_half_minute_is_kept(kept: Callable[[list[int]], list[int]]) -> None:
    given = [ZERO_NS + k * 1000 * MS for k in range(45)]
    assert kept(given) == given[-31:]
    edge_ns = ZERO_NS + 30_000 * MS
    assert kept([ZERO_NS, edge_ns]) == [ZERO_NS, edge_ns]
    assert kept([ZERO_NS, edge_ns + 1]) == [edge_ns + 1]


class Aligned:
    """Stands for alignment: notes what it is asked, and gives what it is told to."""

    def __init__(self, found: Alignment) -> None:
        self.found, self.asked = found, list[tuple[Vector, Matrix, Vector, Matrix]]()

    def __call__(self, times: Vector, poses: Matrix, odometry_times: Vector, odometry: Matrix) -> Alignment:
        self.asked.append((times, poses, odometry_times, odometry))
        return self.found


def seen(applied: Correction = IDEAL) -> OdometryComparison:
    """Comparison that has what alignment needs at the least."""
    poses = ((ZERO_NS, Pose(1.0, 2.0, 3.0)), (ZERO_NS + 40 * MS, Pose(4.0, 5.0, -3.0)))
    samples = (MotionSample(ZERO_NS - 500 * MS, 0.1, 0.2), MotionSample(ZERO_NS + 10 * MS, 0.3, 0.4))
    return OdometryComparison(poses, samples, applied=applied)


def corrected(
    monkeypatch: pytest.MonkeyPatch,
    delay: Known | None = None,
    scale_v: Known | None = None,
    scale_u: Known | None = None,
    before: Correction = IDEAL,
) -> Correction:
    """What is applied after this was found."""
    monkeypatch.setattr(
        odometry_correction, "align_odometry", Aligned(Alignment(delay, scale_v, scale_u, None, delay))
    )
    return reconsidered(seen(before), ZERO_NS).applied._replace(left=AS_TOLD)


def test_alignment_gets_all_in_seconds_from_the_first_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    align = Aligned(UNKNOWN)
    monkeypatch.setattr(odometry_correction, "align_odometry", align)
    reconsidered(seen(), ZERO_NS)
    ((times, poses, odometry_times, odometry),) = align.asked
    assert times == pytest.approx([0.0, 0.04])
    assert odometry_times == pytest.approx([-0.5, 0.01])
    assert np.array_equal(poses, [[1.0, 2.0, 3.0], [4.0, 5.0, -3.0]])
    assert np.array_equal(odometry, [[0.1, 0.2], [0.3, 0.4]])


def test_it_is_asked_once_a_second_and_not_before_there_are_two_of_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    align = Aligned(Alignment(Known(0.1, 0.001), None, None, None, Known(0.1, 0.001)))
    monkeypatch.setattr(odometry_correction, "align_odometry", align)
    whole = seen()
    for short in (
        OdometryComparison(whole.poses[:1], whole.samples),
        OdometryComparison(whole.poses, whole.samples[:1]),
    ):
        assert reconsidered(short, ZERO_NS).applied == IDEAL
    assert align.asked == []
    first = reconsidered(whole, ZERO_NS)
    assert (first.found, first.applied.delay) == (align.found, 0.1)
    assert reconsidered(first, ZERO_NS + 1000 * MS - 1) is first
    assert len(align.asked) == 1
    reconsidered(first, ZERO_NS + 1000 * MS)
    assert len(align.asked) == 2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("off", "sd", "begins"),
    [
        (0.021, 0.0, True),
        (0.019, 0.0, False),
        (0.04, 0.0099, True),
        (0.04, 0.0101, False),
        (0.3, 0.074, True),
        (0.3, 0.076, False),
    ],
)
def test_a_correction_begins_where_the_odometry_is_surely_off_by_more_than_is_worth_it(
    monkeypatch: pytest.MonkeyPatch, off: float, sd: float, begins: bool, sign: float
) -> None:
    off *= sign
    assert corrected(monkeypatch, delay=Known(off, sd)) == (Correction(delay=off) if begins else IDEAL)
    scale = Known(1.0 + off, sd)
    expected = scale.value if begins else 1.0
    assert corrected(monkeypatch, scale_v=scale) == Correction(scale_v=expected)
    assert corrected(monkeypatch, scale_u=scale) == Correction(scale_u=expected)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_one_that_has_begun_follows_until_odometry_is_within_half_of_that(
    monkeypatch: pytest.MonkeyPatch, sign: float
) -> None:
    before = Correction(0.2, 1.3, 0.7)
    for off, lasts in ((0.0101 * sign, True), (0.0099 * sign, False)):
        # However uncertain, it is the best that is known.
        found = Known(off, 1.0), Known(1.0 + off, 1.0), Known(1.0 + off, 1.0)
        expected = Correction(off, 1.0 + off, 1.0 + off) if lasts else IDEAL
        assert corrected(monkeypatch, *found, before=before) == expected


def answering(
    monkeypatch: pytest.MonkeyPatch,
    delay: Known,
    lag: Known | None,
    given: InputTrust = PERFECT,
    before: Correction = IDEAL,
) -> Correction:
    """What is applied after an alignment with a lag, given what odometry is trusted with."""
    late = Known(delay.value + (lag.value if lag else 0.0), 0.01)
    monkeypatch.setattr(
        odometry_correction, "align_odometry", Aligned(Alignment(delay, None, None, lag, late))
    )
    return reconsidered(seen(before), ZERO_NS, given).applied


def test_a_lag_is_applied_where_it_is_sure_and_else_its_time_is_one_of_delay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sure = answering(monkeypatch, Known(0.08, 0.01), Known(0.15, 0.02))
    assert sure.delay == pytest.approx(0.08)
    assert sure.time_constant == pytest.approx(0.15)
    assert sure.left == pytest.approx(0.03)
    unsure = answering(monkeypatch, Known(0.08, 0.01), Known(0.15, 0.04))
    assert unsure.delay == pytest.approx(0.23)
    assert unsure.time_constant == AS_TOLD
    # What was told of the lag is what a delay comes on top of.
    told = InputTrust(0.01, 0.1, time_constant=0.15)
    kept = answering(monkeypatch, Known(0.23, 0.01), None, told)
    assert kept.delay == pytest.approx(0.08)
    assert kept.time_constant == AS_TOLD
    same = answering(monkeypatch, Known(0.08, 0.01), Known(0.16, 0.02), told)
    assert same.delay == pytest.approx(0.09)
    assert same.time_constant == AS_TOLD


def test_of_a_motion_that_is_told_to_come_later_nobody_knows_how_a_delay_is_not_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = InputTrust(0.01, 0.1, lag=0.3)
    for unsure in (None, Known(0.15, 0.04)):
        late = 0.08 if unsure else 0.23
        assert answering(monkeypatch, Known(late, 0.01), unsure, told) == IDEAL
    # A delay alone, or one beyond what is told, is one.
    alone = answering(monkeypatch, Known(0.2, 0.01), Known(0.0, 0.02), told)
    assert alone.time_constant == AS_TOLD
    assert left_of(told, alone) == pytest.approx(0.09)
    assert alone.delay == pytest.approx(0.2)
    beyond = answering(monkeypatch, Known(0.4, 0.01), None, told)
    assert beyond.delay == pytest.approx(0.4)
    # Once told apart, that is what later findings are seen by.
    apart = answering(monkeypatch, Known(0.08, 0.01), Known(0.15, 0.02), told)
    assert answering(monkeypatch, Known(0.24, 0.01), None, told, apart).delay == pytest.approx(0.09)


def test_what_is_told_of_odometry_is_taken_off_before_it_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    align = Aligned(UNKNOWN)
    monkeypatch.setattr(odometry_correction, "align_odometry", align)
    reconsidered(seen(), ZERO_NS, InputTrust(0.01, 0.1, delay=0.2, scale_v=2.0, scale_u=0.5))
    ((_, _, odometry_times, odometry),) = align.asked
    assert odometry_times == pytest.approx([-0.3, 0.21])
    assert np.allclose(odometry, [[0.2, 0.1], [0.6, 0.2]])


def test_what_is_no_longer_known_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    before = Correction(0.2, 1.3, 0.7)
    assert corrected(monkeypatch, before=before) == before
    assert corrected(monkeypatch, scale_v=Known(1.2, 0.01), before=before) == Correction(0.2, 1.2, 0.7)
