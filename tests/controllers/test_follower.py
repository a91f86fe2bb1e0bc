"""One command from one estimate, compiled and interpreted, and against its parts."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from controllers.follower import (
    Command,
    Commanded,
    FollowerSettings,
    FollowerState,
    Outlook,
    command,
)
from controllers.guard import Standing, StopReason
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from controllers.resolution import NO_REMAINDER, Resolution
from controllers.side_change import SideChange
from controllers.station_keeper import StationKeeper, StationState
from formation.kernel import entry
from formation.line import line_of
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import Spacing
from tests.bits import same_bits

LIMITS = Limits(0.22, 2.84)
GAINS = Gains(1.5, 2.0, Spacing(0.2, 20.0), tilt=0.5)
KEEPER = StationKeeper(GAINS, LIMITS, knows_turn=True, may_change=True)
FRESH = Standing(0.05, True, True, False, False)


@entry
def compiled(
    state: FollowerState, settings: FollowerSettings, outlook: Outlook, standing: Standing, elapsed: float
) -> Commanded:
    return command(state, settings, outlook, standing, elapsed)


def settings(v_step: float = 0.0, u_step: float = 0.0) -> FollowerSettings:
    return FollowerSettings(KEEPER.settings, Resolution(v_step, u_step).steps, 0.2)


angles = st.floats(-math.pi, math.pi)
shapes = st.builds(Shape, st.floats(0.05, 5.0), angles, angles)
signs = st.sampled_from([-1.0, 1.0])
states = st.builds(
    FollowerState,
    st.builds(StationState, signs, st.builds(SideChange, signs, angles, st.booleans()), st.booleans()),
    st.builds(Motion, st.floats(-0.005, 0.005), st.floats(-0.02, 0.02)),
)
outlooks = st.builds(
    Outlook,
    shapes.map(line_of),
    st.builds(Motion, st.floats(0.0, 0.3), st.floats(-1.0, 1.0)),
    st.one_of(st.just(math.nan), st.floats(-1.0, 1.0)),
    st.booleans(),
)
standings = st.one_of(
    st.just(FRESH),
    st.builds(Standing, st.floats(-0.1, 0.3), st.booleans(), st.booleans(), st.booleans(), st.booleans()),
)
steps = st.sampled_from([0.0, 0.01, 0.04])


@given(states, outlooks, standings, steps, steps)
def test_a_command_is_within_the_limits_and_the_same_compiled(
    state: FollowerState, outlook: Outlook, standing: Standing, v_step: float, u_step: float
) -> None:
    by = settings(v_step, u_step)
    found = command(state, by, outlook, standing, 0.01)
    same_bits(found, compiled(state, by, outlook, standing, 0.01))
    sent = found.command
    assert abs(sent.v) <= LIMITS.v_max
    assert abs(sent.u) <= LIMITS.u_max
    if sent.stop is not None:
        assert (sent.v, sent.u, sent.saturated) == (0.0, 0.0, False)
        assert found.state == FollowerState(state.station._replace(interrupted=True), NO_REMAINDER)
    else:
        assert standing == FRESH or standing.known
        assert not found.state.station.interrupted
        for value, step in ((sent.v, v_step), (sent.u, u_step)):
            assert step == 0.0 or abs(value / step - round(value / step)) < 1e-5 or abs(value) in LIMITS_SET


LIMITS_SET = (LIMITS.v_max, LIMITS.u_max)


@given(shapes, st.floats(0.0, 0.3), st.floats(-1.0, 1.0))
def test_without_steps_and_orders_it_is_the_law_within_its_limits(shape: Shape, v1: float, u1: float) -> None:
    state = FollowerState(KEEPER.begin(), NO_REMAINDER)
    outlook = Outlook(line_of(shape), Motion(v1, u1), u1, True)
    found = command(state, settings(), outlook, FRESH, 0.01)
    wanted = LAWS["ideal"](shape, v1, u1, GAINS, LIMITS)
    sent, saturated = LIMITS.apply(wanted)
    assert found == Commanded(state, Command(sent.v, sent.u, wanted.v, wanted.u, saturated, 0))


def test_numbers_that_are_none_are_not_looked_at() -> None:
    torn = Outlook(line_of(Shape(math.nan, 0.0, 0.0)), Motion(math.nan, math.nan), math.nan, False)
    state = FollowerState(KEEPER.begin(), NO_REMAINDER)
    found = command(state, settings(), torn, FRESH, 0.01)
    assert found.command.stop is StopReason.NOT_FINITE
    unknown = command(state, settings(), torn, FRESH._replace(known=False), 0.01)
    assert unknown.command.stop is StopReason.NO_ESTIMATE
