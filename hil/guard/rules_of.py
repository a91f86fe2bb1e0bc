"""What guards go by, of a scenario."""

from __future__ import annotations

import math

from msgspec import UnsetType

from hil.guard.robot_guard import GuardRules
from hil.scenario.parts import limits
from hil.scenario.schema import Scenario

_ANYWHERE = (-math.inf, -math.inf, math.inf, math.inf)


def guard_rules(scenario: Scenario, body: str) -> GuardRules:
    """Rules of the guard of a robot, by its body in the motion capture."""
    given, robot, within = scenario.guard, scenario.robot, limits(scenario)
    fence = _ANYWHERE if isinstance(given.fence, UnsetType) else given.fence
    x_min, y_min, x_max, y_max = map(float, fence)
    return GuardRules(
        age_s=float(given.age_s),
        latch_s=float(given.latch_s),
        v_max=within.v_max,
        u_max=within.u_max,
        v_rate=float(robot.v_rate) or math.inf,
        u_rate=float(robot.u_rate) or math.inf,
        body=body,
        fence=(x_min, y_min, x_max, y_max),
        separation=float(given.separation),
    )
