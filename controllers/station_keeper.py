"""The law at the follower's station, and the way round to the other side when that is ordered."""

from __future__ import annotations

from dataclasses import dataclass, replace

from controllers.laws import Gains, Law
from controllers.limits import Limits
from controllers.side_change import SideChange, change_step, change_to, gentle, kept
from formation.pose import Motion
from formation.shape import Shape
from formation.station import Side


@dataclass(frozen=True, slots=True)
class Keeping:
    """Which side was ordered last, and where the follower is on its way there.

    ``interrupted``: the follower had to stand since it was last led.
    """

    ordered: Side
    change: SideChange
    interrupted: bool = False

    @property
    def waits(self) -> bool:
        """Whether a change was ordered that has not begun."""
        return self.ordered is not self.change.station.side


class StationKeeper:
    """What the follower should drive, by a law at the side that was ordered last.

    Whoever lets a follower change sides, a daemon or a simulation, does so by this. Orders are taken only if
    ``may_change``: the leader, at its fastest, turns gently enough for :mod:`controllers.side_change` to
    hold. A change begins once it is seen to do so; after a stop it begins anew from where the pair then is.
    Unless ``knows_turn`` the leader's turn rate is taken for 0 on the way.
    """

    def __init__(self, law: Law, gains: Gains, limits: Limits, *, knows_turn: bool, may_change: bool) -> None:
        self.law, self.gains, self.limits = law, gains, limits
        self.knows_turn, self.may_change = knows_turn, may_change

    def begin(self) -> Keeping:
        """At the station of the gains."""
        return Keeping(self.gains.station.side, kept(self.gains))

    def told(self, keeping: Keeping, side: Side) -> Keeping | None:
        """After an order to drive on a side; None where that would be an unsafe change, so is refused."""
        if side is not keeping.ordered and not self.may_change:
            return None
        return replace(keeping, ordered=side)

    def drive(
        self, keeping: Keeping, shape: Shape, leader: Motion, u1: float, elapsed: float
    ) -> tuple[Keeping, Motion]:
        """Wanted motion, not yet limited, for the shape in which it will act.

        ``leader``: its motion as seen. ``u1``: its turn rate as the law is to take it. ``elapsed`` [s]: since
        the last command.
        """
        change = keeping.change
        bound = keeping.ordered if gentle(leader.v, leader.u, self.gains) else change.station.side
        if bound is not change.station.side or (keeping.interrupted and not change.arrived):
            change = change_to(bound, shape, self.gains)
        change, wanted = change_step(
            change,
            shape,
            leader.v,
            u1 if self.knows_turn or change.arrived else 0.0,
            self.law,
            self.gains,
            self.limits,
            elapsed,
        )
        return replace(keeping, change=change, interrupted=False), wanted
