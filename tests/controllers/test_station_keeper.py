from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from controllers.side_change import CORRECTION
from controllers.station_keeper import StationKeeper, StationState
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import Spacing
from formation.station import Side, Station

GAINS, LIMITS = Gains(1.0, 2.0, Spacing(0.5, 2.0)), Limits(1.5, 2.84)
AT_STATION = Shape(0.5, -0.5 * math.pi, 0.5 * math.pi)
V1 = 0.5
TOO_HARD = 1.1 * CORRECTION * V1 / GAINS.spacing.rho_0


def keeper(law: str = "independent", *, may_change: bool = True) -> StationKeeper:
    return StationKeeper(GAINS, LIMITS, knows_turn=law != "independent", may_change=may_change)


def ordered(side: Side) -> StationState:
    state = keeper().order(keeper().begin(), side)
    assert state is not None
    return state


def test_where_a_change_is_unsafe_an_order_for_another_side_is_refused() -> None:
    strict = keeper(may_change=False)
    assert strict.order(strict.begin(), Side.RIGHT) == strict.begin()
    assert strict.order(strict.begin(), Side.LEFT) is None


@given(
    shape=st.builds(Shape, st.floats(0.1, 5.0), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1)),
    v1=st.floats(0.0, 1.0),
    u1=st.floats(-2.0, 2.0),
    law=st.sampled_from(["independent", "ideal"]),
)
def test_without_orders_it_is_the_law_to_the_last_bit(shape: Shape, v1: float, u1: float, law: str) -> None:
    state, motion = keeper(law).drive(keeper(law).begin(), shape, Motion(v1, u1), u1, 0.01)
    assert motion == LAWS[law](shape, v1, u1, GAINS, LIMITS)
    assert state == keeper(law).begin()


def test_a_change_waits_for_a_leader_that_turns_gently() -> None:
    waiting, motion = keeper().drive(ordered(Side.LEFT), AT_STATION, Motion(V1, TOO_HARD), math.nan, 0.01)
    assert waiting.waits
    assert motion == LAWS["independent"](AT_STATION, V1, math.nan, GAINS, LIMITS)
    begun, motion = keeper().drive(waiting, AT_STATION, Motion(V1, 0.0), math.nan, 0.01)
    assert not begun.waits
    assert not begun.change.arrived
    assert motion.v < V1, "it falls behind first"


def test_a_leader_that_turns_harder_on_the_way_does_not_end_the_change() -> None:
    begun, _ = keeper().drive(ordered(Side.LEFT), AT_STATION, Motion(V1, 0.0), math.nan, 0.01)
    going, _ = keeper().drive(begun, AT_STATION, Motion(V1, TOO_HARD), math.nan, 0.01)
    assert (going.change.side, going.change.arrived) == (Side.LEFT, False)


@pytest.mark.parametrize("u1", [0.0, TOO_HARD])
def test_after_a_stop_a_change_begins_anew_from_where_the_pair_is(u1: float) -> None:
    """The leader has driven on meanwhile: the place on the way that was left is somewhere else now."""
    begun, _ = keeper().drive(ordered(Side.LEFT), AT_STATION, Motion(V1, 0.0), math.nan, 0.01)
    behind = Shape(1.5, 2.5, 0.3)
    going, _ = keeper().drive(begun._replace(interrupted=True), behind, Motion(V1, u1), math.nan, 0.01)
    assert going.change.side is Side.LEFT
    assert going.change.phase == pytest.approx(behind.alpha1, abs=0.02)
    assert not going.interrupted


def test_after_a_stop_at_its_station_the_law_goes_on() -> None:
    stood = keeper().begin()._replace(interrupted=True)
    state, motion = keeper().drive(stood, AT_STATION, Motion(V1, 0.0), math.nan, 0.01)
    assert state == keeper().begin()
    assert motion == LAWS["independent"](AT_STATION, V1, math.nan, GAINS, LIMITS)


def test_on_the_way_the_change_goes_on_from_where_it_was_and_not_from_where_the_pair_is() -> None:
    begun, _ = keeper().drive(ordered(Side.LEFT), AT_STATION, Motion(V1, 0.0), math.nan, 0.01)
    phase = begun.change.phase
    aside = AT_STATION._replace(alpha1=phase - 0.2)
    going, _ = keeper().drive(begun, aside, Motion(V1, 0.0), math.nan, 0.01)
    assert going.change.phase == pytest.approx(phase, abs=0.01)


@pytest.mark.parametrize("law", ["independent", "ideal"])
def test_by_the_law_alone_it_drives_at_the_side_that_it_goes_to(law: str) -> None:
    begun, _ = keeper(law).drive(ordered(Side.LEFT), AT_STATION, Motion(V1, 0.0), 0.0, 0.01)
    assert (begun.ordered, begun.change.arrived) == (Side.LEFT, False)
    shape, leader = Shape(0.6, 1.4, -1.7), Motion(V1, 0.3)
    left = Gains(1.0, 2.0, Spacing(0.5, 2.0), Station(Side.LEFT))
    assert keeper(law).by_law(begun, shape, leader) == LAWS[law](shape, V1, 0.3, left, LIMITS)
    assert keeper(law).by_law(keeper(law).begin(), shape, leader) == LAWS[law](shape, V1, 0.3, GAINS, LIMITS)
