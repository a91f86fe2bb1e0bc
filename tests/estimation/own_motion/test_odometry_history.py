from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.lagged_signal import LaggedSignal
from estimation.own_motion.odometry_history import (
    IDEAL,
    Correction,
    InputTrust,
    MotionSample,
    answer_again,
    answer_at,
    follower_motion,
    left_of,
    motion_at,
    remember,
    sample_at,
    time_constant_of,
)
from formation.records import Rows, rows_of, store
from formation.ring import EMPTY, Ring

MS = 1_000_000
TRUST = InputTrust(sd_v2=0.005, sd_u2=0.03)


def remembered(samples: Iterable[MotionSample], span: float = 10.0, room: int = 32) -> list[MotionSample]:
    rows, ring = rows_of(MotionSample, room), EMPTY
    for sample in samples:
        ring = remember(rows, ring, sample, span)
    return [sample_at(rows, ring, k) for k in range(ring.length)]


def kept(samples: Sequence[MotionSample]) -> tuple[Rows[MotionSample], Ring]:
    """Rows whose ring begins somewhere in the middle."""
    rows, ring = rows_of(MotionSample, 32), Ring(29, len(samples))
    for k, sample in enumerate(samples):
        store(rows, (29 + k) % 32, sample)
    return rows, ring


def motion_from(samples: Sequence[MotionSample], capture_ns: int, trust: InputTrust) -> FollowerMotion:
    return follower_motion(*kept(samples), capture_ns, trust, IDEAL)


def ramp(count: int = 11) -> list[MotionSample]:
    """v2 rises by 0.1 m/s and u2 falls by 0.2 rad/s every 100 ms."""
    return [MotionSample(100 * MS * k, 0.1 * k, -0.2 * k) for k in range(count)]


@given(st.permutations(ramp()))
@settings(deadline=None)
def test_the_order_of_arrival_does_not_matter(samples: list[MotionSample]) -> None:
    assert remembered(samples) == ramp()


@given(st.permutations(ramp(21)))
@settings(deadline=None)
def test_what_is_forgotten_does_not_depend_on_the_order_either(samples: list[MotionSample]) -> None:
    assert remembered(samples, span=0.55) == ramp(21)[15:]


def test_of_equal_stamps_the_newer_arrival_wins() -> None:
    history = remembered([*ramp(3), MotionSample(100 * MS, 7.0, 8.0)])
    assert [sample.v2 for sample in history] == [0.0, 7.0, 0.2]


@given(st.permutations(ramp(21)))
@settings(deadline=None)
def test_where_there_is_no_room_the_oldest_is_forgotten_in_whatever_order_they_come(
    samples: list[MotionSample],
) -> None:
    assert remembered(samples, room=8) == ramp(21)[13:]


@given(st.integers(0, 1000 * MS))
@settings(deadline=None)
def test_motion_between_samples_lies_on_the_line_between_them(stamp_ns: int) -> None:
    found = motion_at(*kept(ramp()), stamp_ns)
    assert found.v2 == pytest.approx(stamp_ns * 1e-9, abs=1e-12)
    assert found.u2 == pytest.approx(-2e-9 * stamp_ns, abs=1e-12)


def test_motion_is_held_outside_the_samples() -> None:
    history = ramp()
    assert motion_at(*kept(history), -5) == history[0]
    assert motion_at(*kept(history), 5000 * MS) == history[-1]


def test_a_sample_is_given_back_as_it_was() -> None:
    assert motion_at(*kept(ramp()), 300 * MS) == ramp()[3]


def test_a_delayed_signal_is_looked_up_where_its_stamp_says() -> None:
    # What happened at 0.3 s is stamped 0.4 s if the delay is counted against the sensor.
    late = motion_from(ramp(), 400 * MS, InputTrust(0.005, 0.03, delay=0.1))
    assert late == FollowerMotion(0.1 * 3, -0.2 * 3, 0.005, 0.03)


def test_odometry_is_corrected_by_its_scales_and_its_delay_adds_to_the_known_one() -> None:
    trust, correction = InputTrust(0.005, 0.03, delay=0.1), Correction(0.1, 1.1, 0.9)
    found = follower_motion(*kept(ramp()), 500 * MS, trust, correction)
    assert found == FollowerMotion(1.1 * (0.1 * 3), 0.9 * (-0.2 * 3), 0.005, 0.03)


def test_steady_motion_is_trusted_and_changing_motion_less() -> None:
    steady = [MotionSample(100 * MS * k, 0.2, 0.5) for k in range(11)]
    trust = InputTrust(0.005, 0.03, lag=0.2)
    assert motion_from(steady, 1000 * MS, trust) == FollowerMotion(0.2, 0.5, 0.005, 0.03)
    changing = motion_from(ramp(), 1000 * MS, trust)
    assert changing.v2 == pytest.approx(1.0)
    assert changing.sd_v2 == pytest.approx(math.hypot(0.005, 0.2))
    assert changing.sd_u2 == pytest.approx(math.hypot(0.03, 0.4))


def test_a_short_excursion_within_the_lag_is_not_overlooked() -> None:
    there_and_back = [
        MotionSample(0, 0.1, 0.0),
        MotionSample(450 * MS, 0.3, 0.0),
        MotionSample(500 * MS, 0.1, 0.0),
    ]
    found = motion_from(there_and_back, 500 * MS, InputTrust(0.0, 0.0, lag=0.2))
    assert found.v2 == pytest.approx(0.1)
    assert found.sd_v2 == pytest.approx(0.2)


def test_a_follower_that_never_spoke_stands_give_or_take_its_limits() -> None:
    assert motion_from([], 1000, TRUST) == FollowerMotion(0.0, 0.0, 0.005, 0.03)
    limited = InputTrust(0.005, 0.03, v_max=0.2, u_max=0.01)
    assert motion_from([], 1000, limited) == FollowerMotion(0.0, 0.0, 0.2, 0.03)


TIME_CONSTANT = 0.15


def answered_history(samples: Sequence[MotionSample]) -> tuple[Rows[MotionSample], Ring]:
    rows, ring = kept(samples)
    answer_again(rows, ring, 0, TIME_CONSTANT)
    return rows, ring


def uneven() -> tuple[list[MotionSample], LaggedSignal]:
    """Samples at uneven times, and the same for one who looks at all of them at once."""
    stamps = [0, 40, 70, 170, 175, 300, 520, 560, 900, 1000]
    samples = [MotionSample(ms * MS, math.sin(0.01 * ms), math.cos(0.02 * ms)) for ms in stamps]
    told = np.array([complex(each.v2, each.u2) for each in samples])
    return samples, LaggedSignal(np.array(stamps) * 1e-3, told, held=False)


@given(st.integers(0, 1000 * MS))
@settings(deadline=None)
def test_the_answer_of_a_lag_is_exact_between_samples_of_any_spacing(stamp_ns: int) -> None:
    samples, signal = uneven()
    found = answer_at(*answered_history(samples), stamp_ns, TIME_CONSTANT)
    (expected,) = signal.answers(np.array([stamp_ns * 1e-9]), TIME_CONSTANT, signal.states(TIME_CONSTANT))
    assert complex(found.v2, found.u2) == pytest.approx(expected, abs=1e-12)


def test_after_the_newest_sample_the_answer_goes_on_to_it() -> None:
    rows, ring = answered_history([MotionSample(0, 0.0, 1.0), MotionSample(100 * MS, 0.2, -1.0)])
    now, later = (answer_at(rows, ring, ms * MS, TIME_CONSTANT) for ms in (100, 250))
    assert later.v2 == pytest.approx(0.2 + (now.v2 - 0.2) * math.exp(-1.0))
    assert answer_at(rows, ring, 5000 * MS, TIME_CONSTANT).u2 == pytest.approx(-1.0)


def test_a_sample_that_comes_late_changes_the_answers_after_it() -> None:
    samples, _ = uneven()
    whole, ring = answered_history(samples)
    late = samples.pop(4)
    rows, short = answered_history(samples)
    short = remember(rows, short, late, 10.0)
    answer_again(rows, short, late.stamp_ns, TIME_CONSTANT)
    found = [sample_at(rows, short, k) for k in range(short.length)]
    assert found == [sample_at(whole, ring, k) for k in range(ring.length)]


def test_a_correction_takes_the_place_of_what_is_told_of_the_lag() -> None:
    told = InputTrust(0.005, 0.03, lag=0.3, time_constant=0.2)
    assert (time_constant_of(told, IDEAL), left_of(told, IDEAL)) == (0.2, 0.3)
    found = Correction(time_constant=0.1, left=0.05)
    assert (time_constant_of(told, found), left_of(told, found)) == (0.1, 0.05)
    # Nothing makes a motion come later than it is told to at most.
    assert left_of(told, Correction(left=0.4)) == 0.3
    samples, _ = uneven()
    rows, ring = answered_history(samples)
    trust = InputTrust(0.005, 0.03, time_constant=TIME_CONSTANT, scale_v=2.0, scale_u=0.5)
    at = answer_at(rows, ring, 500 * MS, TIME_CONSTANT)
    motion = follower_motion(rows, ring, 500 * MS, trust, Correction(scale_v=1.5))
    assert [motion.v2, motion.u2] == [pytest.approx(3.0 * at.v2), pytest.approx(0.5 * at.u2)]
