from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.interval_motion import LASTING, motion_between, travelled
from estimation.own_motion.odometry_history import (
    IDEAL,
    Correction,
    InputTrust,
    MotionSample,
    answer_again,
    answer_at,
)
from estimation.own_motion.own_track import ODOMETRY_CORRELATION
from formation.records import Rows, rows_of, store
from formation.ring import EMPTY, Ring

MS = 1_000_000
TRUST = InputTrust(sd_v2=0.005, sd_u2=0.03)


def kept(samples: Sequence[MotionSample]) -> tuple[Rows[MotionSample], Ring]:
    """Rows whose ring begins somewhere in the middle."""
    rows = rows_of(MotionSample, 64)
    for k, sample in enumerate(samples):
        store(rows, (60 + k) % 64, sample)
    return rows, Ring(60, len(samples))


def turn_in_between() -> list[MotionSample]:
    """A turn by half a radian between 0.3 and 0.8 s, of which 0 and 1 s know nothing."""
    return [MotionSample(ms * MS, 0.1, 1.0 if 300 <= ms < 800 else 0.0) for ms in range(0, 1001, 20)]


def between(samples: Sequence[MotionSample], trust: InputTrust, *ms: int) -> FollowerMotion:
    return motion_between(*kept(samples), (ms[0] * MS, ms[1] * MS), trust, IDEAL)


def test_a_turn_between_two_sightings_is_not_lost() -> None:
    found = between(turn_in_between(), TRUST, 0, 1000)
    assert [found.v2, found.u2] == [pytest.approx(0.1), pytest.approx(0.5, abs=1e-9)]
    assert (found.sd_v2, found.sd_u2) == (TRUST.sd_v2, TRUST.sd_u2)


def test_ways_add_up_wherever_they_are_parted() -> None:
    rows, ring = kept(turn_in_between())
    whole = travelled(rows, ring, 13 * MS, 987 * MS)
    parts = [travelled(rows, ring, a * MS, b * MS) for a, b in ((13, 305), (305, 306), (306, 987))]
    assert sum(part.u for part in parts) == pytest.approx(whole.u, abs=1e-12)
    assert sum(part.v for part in parts) == pytest.approx(whole.v, abs=1e-12)


def test_outside_of_what_was_heard_the_motion_is_held() -> None:
    found = between([MotionSample(500 * MS, 0.2, -0.3)], TRUST, 0, 2000)
    assert [found.v2, found.u2] == [pytest.approx(0.2), pytest.approx(-0.3)]


def test_a_delay_shifts_the_interval_and_scales_scale() -> None:
    late = InputTrust(0.005, 0.03, delay=0.1)
    found = motion_between(*kept(turn_in_between()), (400 * MS, 800 * MS), late, Correction(0.1, 1.1, 0.9))
    whole = between(turn_in_between(), TRUST, 200, 600)
    assert [found.v2, found.u2] == [pytest.approx(1.1 * whole.v2), pytest.approx(0.9 * whole.u2)]


def test_of_a_lag_every_delay_is_as_likely_and_what_they_differ_by_is_told() -> None:
    step = [MotionSample(ms * MS, 0.0, 0.0 if ms < 1000 else 0.8) for ms in range(0, 2001, 40)]
    lagging = InputTrust(0.0, 0.0, lag=0.4)
    before, after = between(step, lagging, 500, 600), between(step, lagging, 1500, 1600)
    amid = between(step, lagging, 1190, 1210)
    assert [before.u2, before.sd_u2] == [0.0, pytest.approx(0.0, abs=1e-6)]
    assert [after.u2, after.sd_u2] == [pytest.approx(0.8), pytest.approx(0.0, abs=1e-6)]
    assert amid.u2 == pytest.approx(0.4, abs=0.1)
    # Delays of 0, 0.1, .. 0.4 s: half of them say 0.8 rad/s, half say 0.
    assert amid.sd_u2 == pytest.approx(0.38 * math.sqrt(LASTING / ODOMETRY_CORRELATION), rel=0.1)


def test_slip_grows_with_what_is_driven() -> None:
    slipping = InputTrust(0.005, 0.03, slip_v=0.1, slip_u=0.2)
    found = between([MotionSample(0, 0.3, 1.0)], slipping, 0, 100)
    lasting = LASTING / ODOMETRY_CORRELATION
    assert found.sd_v2 == pytest.approx(math.sqrt(0.005**2 + lasting * 0.03**2))
    assert found.sd_u2 == pytest.approx(math.sqrt(0.03**2 + lasting * 0.2**2))


def test_who_was_never_heard_stands_give_or_take_its_limits() -> None:
    limited = InputTrust(0.005, 0.03, v_max=0.2, u_max=0.01)
    found = motion_between(rows_of(MotionSample, 4), EMPTY, (0, MS), limited, IDEAL)
    assert found == FollowerMotion(0.0, 0.0, 0.2, 0.03)


def test_the_way_of_a_lags_answer_is_its_integral() -> None:
    rows, ring = kept(turn_in_between())
    answer_again(rows, ring, 0, 0.15)
    trust = InputTrust(0.005, 0.03, time_constant=0.15, scale_u=0.9)
    found = motion_between(rows, ring, (313 * MS, 988 * MS), trust, IDEAL)
    steps = 4000
    middles = [313 * MS + round((k + 0.5) * 675 * MS / steps) for k in range(steps)]
    mean = sum(answer_at(rows, ring, at_ns, 0.15).u2 for at_ns in middles) / steps
    assert found.u2 == pytest.approx(0.9 * mean, abs=1e-6)
    assert found.v2 == pytest.approx(0.1)
