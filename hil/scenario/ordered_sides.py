"""Orders to change sides that a scenario gives its follower: which, when, and whether they will be taken."""

from __future__ import annotations

from itertools import cycle

from controllers.side_change import CORRECTION
from formation.station import Side
from hil.scenario.parts import may_change_sides
from hil.scenario.schema import Scenario


def ordered_sides(scenario: Scenario) -> tuple[tuple[float, Side], ...]:
    """When [s] since the leader set off the follower is told to go to which side, earliest first."""
    side = Side(scenario.formation.side)
    moments = sorted(scenario.formation.change_sides_at_s)
    return tuple(zip(moments, cycle((side.other, side)), strict=False))


def refusal(scenario: Scenario) -> str | None:
    """Why the scenario's orders to change sides will all be refused, and what to do; None if they won't."""
    if not ordered_sides(scenario) or may_change_sides(scenario):
        return None
    leader = scenario.leader
    most = CORRECTION * leader.k_v / scenario.formation.rho_0
    return (
        f"formation.change_sides_at_s: each order will be refused (unsafe_side_change), as leader.k_u is "
        f"{leader.k_u:g} rad/s, expected at most {CORRECTION:g} k_v / rho_0 = {most:.3g}; lower it if the "
        "leader never turns harder"
    )
