from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.limits import Limits
from controllers.resolution import NO_REMAINDER, Resolution
from formation.pose import Motion

LIMITS = Limits(0.22, 2.84)
STEPS = Resolution(0.01, 0.01)
wanted_motion = st.builds(Motion, st.floats(-0.22, 0.22), st.floats(-2.84, 2.84))


def as_the_firmware_takes_it(value: float) -> float:
    """Hundredths, cut off: what a TurtleBot3's link does with a command."""
    return int(value * 100) / 100


@given(wanted_motion)
def test_on_average_the_robot_gets_what_was_wanted(wanted: Motion) -> None:
    remainder, got_v, got_u, count = NO_REMAINDER, 0.0, 0.0, 200
    for _ in range(count):
        sent, remainder = STEPS.round(wanted, remainder, LIMITS)
        assert LIMITS.apply(sent) == (sent, False)
        assert max(abs(remainder.v), abs(remainder.u)) <= 0.005 + 1e-12
        got_v, got_u = (
            got_v + as_the_firmware_takes_it(sent.v),
            got_u + as_the_firmware_takes_it(sent.u),
        )
    # What is left after any number of commands is half a step in all.
    assert got_v / count == pytest.approx(wanted.v, abs=0.006 / count)
    assert got_u / count == pytest.approx(wanted.u, abs=0.006 / count)


@pytest.mark.parametrize("steps", range(-284, 285))
def test_a_link_that_truncates_takes_whole_steps_as_they_are(steps: int) -> None:
    sent, remainder = STEPS.round(Motion(0.0, steps * 0.01), NO_REMAINDER, LIMITS)
    assert int(sent.u * 100) == steps
    assert abs(remainder.u) < 1e-12


@given(wanted_motion)
def test_without_steps_commands_stay_as_they_are(wanted: Motion) -> None:
    assert Resolution().round(wanted, NO_REMAINDER, LIMITS) == (wanted, NO_REMAINDER)


def test_at_a_limit_nothing_piles_up() -> None:
    limits, remainder = Limits(0.225, 2.0), NO_REMAINDER
    for _ in range(100):
        sent, remainder = STEPS.round(Motion(0.225, 0.0), remainder, limits)
        assert as_the_firmware_takes_it(sent.v) == 0.22
    sent, _ = STEPS.round(Motion(0.1, 0.0), remainder, limits)
    assert as_the_firmware_takes_it(sent.v) in (0.1, 0.11)


@pytest.mark.parametrize("bad", [-0.01, math.nan, math.inf])
def test_a_step_that_is_none_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="expected a finite number"):
        Resolution(v=bad)


@given(wanted_motion, st.floats(-0.005, 0.005), st.floats(-0.02, 0.02))
def test_each_axis_keeps_its_own_steps_and_its_own_remainder(
    wanted: Motion, remainder_v: float, remainder_u: float
) -> None:
    uneven = Resolution(0.01, 0.04)
    sent, rest = uneven.round(wanted, Motion(remainder_v, remainder_u), LIMITS)
    for got, left, due, step, bound in (
        (sent.v, rest.v, wanted.v + remainder_v, 0.01, 0.22),
        (sent.u, rest.u, wanted.u + remainder_u, 0.04, 2.84),
    ):
        whole = round(got / step)
        # A hair beyond whole steps, away from zero, so that a link that truncates keeps them.
        hair = math.copysign(1e-6, whole) if whole else 0.0
        assert got == pytest.approx(max(-bound, min(bound, (whole + hair) * step)), rel=1e-12)
        assert abs(due - whole * step) <= 0.5 * step + 1e-12 or abs(whole) == math.floor(bound / step + 1e-6)
        assert left == pytest.approx(max(-0.5 * step, min(0.5 * step, due - whole * step)), abs=1e-12)


def test_one_axis_in_steps_leaves_the_other_alone() -> None:
    wanted, remainder = Motion(0.1234, 1.2345), Motion(0.0, 0.0)
    sent, rest = Resolution(v=0.01).round(wanted, remainder, LIMITS)
    assert (sent.u, rest.u) == (1.2345, 0.0)
    assert rest.v == pytest.approx(0.0034, abs=1e-12)
    sent, rest = Resolution(u=0.01).round(wanted, remainder, LIMITS)
    assert (sent.v, rest.v) == (0.1234, 0.0)
    assert rest.u == pytest.approx(0.0045, abs=1e-12)


def test_a_remainder_counts_towards_the_next_command_and_half_a_step_is_rounded_up() -> None:
    steps = Resolution(0.125, 0.25)
    sent, rest = steps.round(Motion(0.0625, -0.125), NO_REMAINDER, Limits(1.0, 1.0))
    assert (sent.v, sent.u) == pytest.approx((0.125, 0.0), abs=1e-6)
    assert rest == Motion(-0.0625, -0.125)
    sent, rest = steps.round(Motion(0.125, -0.25), rest, Limits(1.0, 1.0))
    assert (sent.v, sent.u) == pytest.approx((0.125, -0.25), abs=1e-6)
    assert rest == Motion(-0.0625, -0.125)


def test_a_step_of_turning_that_is_none_is_refused_by_name() -> None:
    for bad in (-0.01, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"^u is"):
            Resolution(u=bad)
