"""The law at the follower's station, and the way round to the other side when that is ordered."""

from __future__ import annotations

from typing import NamedTuple

from controllers.laws import Gains, LawSettings, law
from controllers.limits import Limits
from controllers.side_change import SideChange, at_side, change_step, change_to, is_gentle, kept
from formation.kernel import kernel
from formation.line import Line, line_of
from formation.pose import Motion
from formation.shape import Shape
from formation.station import Side, Station


class KeeperSettings(NamedTuple):
    """The law's numbers, at the station to begin with; whether it knows the leader's turn rate.

    ``may_change``: the leader, at its fastest, turns gently enough for :mod:`controllers.side_change` to
    hold.
    """

    law: LawSettings
    knows_turn: bool
    may_change: bool


class StationState(NamedTuple):
    """Which side was ordered last, by its sign, and where the follower is on its way there.

    ``interrupted``: the follower had to stand since it was last led.
    """

    ordered_sign: float
    change: SideChange
    interrupted: bool

    @property
    def ordered(self) -> Side:
        """The side that was ordered last."""
        return Side.of(self.ordered_sign)

    @property
    def waits(self) -> bool:
        """Whether a change was ordered that has not begun."""
        return self.ordered_sign != self.change.sign


class Kept(NamedTuple):
    """State after a step, and the wanted motion, not yet limited."""

    state: StationState
    wanted: Motion


class Ordered(NamedTuple):
    """State after an order, and whether it was taken."""

    state: StationState
    taken: bool


def at_station(station: Station) -> StationState:
    """At its station, and nothing else was ordered."""
    return StationState(station.sign, kept(station), False)


@kernel
def order_side(state: StationState, settings: KeeperSettings, sign: float) -> Ordered:
    """Take an order to drive on a side, or refuse it where that would be an unsafe change."""
    if sign != state.ordered_sign and not settings.may_change:
        return Ordered(state, False)
    return Ordered(state._replace(ordered_sign=sign), True)


@kernel
def keep(
    state: StationState, settings: KeeperSettings, line: Line, leader: Motion, u1: float, elapsed: float
) -> Kept:
    """Wanted motion for the line in which it will act.

    ``leader``: its motion as seen. ``u1``: its turn rate as the law is to take it, not looked at by one that
    knows none. ``elapsed`` [s] > 0: since the last command. A change begins once the leader is seen to turn
    gently enough; after a stop it begins anew from where the pair then is.
    """
    change = state.change
    is_calm = is_gentle(leader.v, leader.u, settings.law.rho_0)
    bound = state.ordered_sign if is_calm else change.sign
    if bound != change.sign or (state.interrupted and not change.arrived):
        change = change_to(bound, line)
    known = u1 if settings.knows_turn else 0.0
    led = change_step(change, settings.law, line, leader.v, known, elapsed)
    return Kept(state._replace(change=led.change, interrupted=False), led.wanted)


class StationKeeper:
    """What the follower should drive, by the law at the side that was ordered last.

    Whoever lets a follower change sides, a daemon or a simulation, does so by these kernels. Unless
    ``knows_turn`` the law is (8), and the leader's turn rate is taken for 0 on the way round.
    """

    def __init__(self, gains: Gains, limits: Limits, *, knows_turn: bool, may_change: bool) -> None:
        self.gains, self.limits = gains, limits
        self.settings = KeeperSettings(gains.settings(limits), knows_turn, may_change)

    def begin(self) -> StationState:
        """At the station of the gains."""
        return at_station(self.gains.station)

    def order(self, state: StationState, side: Side) -> StationState | None:
        """After an order to drive on a side; None where that would be an unsafe change, so is refused."""
        ordered = order_side(state, self.settings, side.sign)
        return ordered.state if ordered.taken else None

    def drive(self, state: StationState, shape: Shape, leader: Motion, u1: float, elapsed: float) -> Kept:
        """Wanted motion for the shape in which it will act, see :func:`keep`."""
        return keep(state, self.settings, line_of(shape), leader, u1, elapsed)

    def by_law(self, state: StationState, shape: Shape, leader: Motion) -> Motion:
        """Wanted motion by the law alone, at the side that a state is on or goes to."""
        there = at_side(self.settings.law, state.change.sign)
        return law(there, line_of(shape), leader.v, leader.u if self.settings.knows_turn else 0.0)
