from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.guard import (
    CLOCK_TOLERANCE_NS,
    Decision,
    Standing,
    StopReason,
    decide,
    reason_of,
)
from controllers.guard import (
    DRIVING as DRIVES,
)
from controllers.limits import Limits
from formation.kernel import entry
from formation.pose import STANDSTILL, Motion
from tests.bits import same_bits

anything = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-1, 1),
    st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]),
)
motions = st.builds(Motion, anything, anything)
limits_drawn = st.builds(Limits, st.floats(1e-3, 10), st.floats(1e-3, 10))
LIMITS = Limits(0.22, 2.84)


@entry
def decide_compiled(
    wanted: Motion, standing: Standing, max_age: float, v_max: float, u_max: float
) -> Decision:
    return decide(wanted, standing, max_age, v_max, u_max)


DRIVING = Motion(0.1, 1.0)


def good(
    wanted: Motion = DRIVING,
    *,
    age: float = 0.05,
    max_age: float = 0.2,
    known: bool = True,
    settled: bool = True,
    lost: bool = False,
    stopped: bool = False,
) -> Decision:
    standing = Standing(age, known, settled, lost, stopped)
    return decide(wanted, standing, max_age, LIMITS.v_max, LIMITS.u_max)


@given(
    motions,
    limits_drawn,
    st.builds(Standing, anything, st.booleans(), st.booleans(), st.booleans(), st.booleans()),
    anything,
)
@settings(deadline=None, max_examples=500)
def test_nothing_unsafe_leaves(wanted: Motion, limits: Limits, standing: Standing, max_age: float) -> None:
    decision = decide(wanted, standing, max_age, limits.v_max, limits.u_max)
    same_bits(decision, decide_compiled(wanted, standing, max_age, limits.v_max, limits.u_max))
    assert math.isfinite(decision.sent.v)
    assert math.isfinite(decision.sent.u)
    assert limits.apply(decision.sent) == (decision.sent, False)
    if decision.stop is not None:
        assert decision.sent == STANDSTILL
        assert not decision.saturated
        return
    assert standing.known
    assert standing.settled
    assert not standing.lost
    assert not standing.stopped
    assert -1e-9 * CLOCK_TOLERANCE_NS <= standing.age <= max_age
    assert (decision.sent, decision.saturated) == limits.apply(wanted)


@given(st.builds(Motion, st.floats(-0.22, 0.22), st.floats(-2.84, 2.84)), st.floats(0.0, 0.2))
@settings(deadline=None)
def test_a_good_command_leaves_as_it_is(wanted: Motion, age: float) -> None:
    assert good(wanted, age=age) == Decision(wanted, wanted, False, DRIVES)


def test_a_command_beyond_the_limits_is_limited_and_says_so() -> None:
    assert good(Motion(-0.5, 3.0)) == Decision(Motion(-0.22, 2.84), Motion(-0.5, 3.0), True, DRIVES)


@pytest.mark.parametrize(
    ("decision", "reason"),
    [
        (good(known=False), StopReason.NO_ESTIMATE),
        (good(settled=False), StopReason.NOT_SETTLED),
        (good(lost=True), StopReason.LOST),
        (good(age=0.2001), StopReason.STALE),
        (good(age=-0.1), StopReason.STALE),
        (good(age=math.nan), StopReason.STALE),
        (good(age=math.inf), StopReason.STALE),
        (good(max_age=math.nan), StopReason.STALE),
        (good(Motion(math.nan, 0.0)), StopReason.NOT_FINITE),
        (good(Motion(0.0, -math.inf)), StopReason.NOT_FINITE),
        (good(stopped=True), StopReason.STOPPED),
    ],
)
def test_each_stop_gives_its_reason(decision: Decision, reason: StopReason) -> None:
    assert decision.stop is reason
    assert decision.sent == STANDSTILL


def test_an_ordered_stop_outranks_every_other_reason() -> None:
    assert good(known=False, settled=False, lost=True, stopped=True).stop is StopReason.STOPPED


def test_clocks_may_differ_by_a_little() -> None:
    assert good(age=-1e-9 * CLOCK_TOLERANCE_NS).stop is None
    assert good(age=-1e-9 * (CLOCK_TOLERANCE_NS + 1)).stop is StopReason.STALE


def test_reasons_and_codes_are_one_to_one_and_driving_is_none_of_them() -> None:
    assert [reason_of(reason.code) for reason in StopReason] == list(StopReason)
    assert reason_of(DRIVES) is None


def test_the_log_keeps_what_was_wanted_before_a_stop() -> None:
    assert good(Motion(0.1, 1.0), age=9.0).wanted == Motion(0.1, 1.0)


def test_the_first_reason_that_applies_is_given() -> None:
    nan = Motion(math.nan, 0.0)
    assert good(nan, age=9.0, settled=False, lost=True, stopped=True).stop is StopReason.STOPPED
    assert good(nan, age=9.0, known=False, settled=False, lost=True).stop is StopReason.NO_ESTIMATE
    assert good(nan, age=9.0, settled=False, lost=True).stop is StopReason.LOST
    assert good(nan, age=9.0, settled=False).stop is StopReason.NOT_SETTLED
    assert good(nan, age=9.0).stop is StopReason.STALE
    assert good(nan).stop is StopReason.NOT_FINITE
