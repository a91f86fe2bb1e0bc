"""What the guard of a robot is told, of a scenario."""

from __future__ import annotations

import math

from msgspec import UnsetType

from hil.errors import UsageError
from hil.guard.order import SESSION, GuardOrder
from hil.guard.robot_guard import GuardRules
from hil.scenario.guarded import with_guards
from hil.scenario.parts import limits
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.key_layout import KeyLayout, layout_of
from hil.wire.lab_robots import LabRobot, robots_of
from hil.wire.ros_tokens import Endpoint, endpoint_token, node_token
from hil.wire.templates import drive_template

_ANYWHERE = (-math.inf, -math.inf, math.inf, math.inf)
_NODE = "abreast_guard"


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


def guard_order(scenario: Scenario, robot: str) -> GuardOrder:
    """The order for the guard of a robot of a scenario, by its name.

    Raises :class:`UsageError` if there is none of that name.
    """
    scenario = with_guards(scenario)
    chosen = _robot(scenario, robot)
    layout, stamped = layout_of(scenario), scenario.controller.command_type == "TwistStamped"
    template = drive_template(chosen.namespace, stamped=stamped)
    return GuardOrder(
        robot=chosen.name,
        rules=guard_rules(scenario, chosen.body),
        wanted=layout.heard(chosen.wanted),
        stop=layout.heard(topics.STOP),
        arm=layout.heard(topics.ARM),
        frames=layout.heard(topics.RIGID_BODIES),
        overheard=layout.heard(chosen.cmd_vel),
        cmd_vel=layout.key(chosen.cmd_vel),
        diagnostics=layout.key(topics.DIAGNOSTICS),
        drive=template.buffer.tobytes().hex(),
        twist_at=template.numbers_at,
        stamped=stamped,
        attached=layout.kind == "rmw_zenoh",
        ros_topic=layout.name(chosen.cmd_vel),
        ros_domain=scenario.wire.domain,
        tokens=_tokens(layout, chosen),
    )


def _robot(scenario: Scenario, name: str) -> LabRobot:
    robots = robots_of(scenario)
    for robot in robots:
        if robot.name == name:
            return robot
    known = ", ".join(robot.name for robot in robots)
    raise UsageError(f"--robot {name!r}: scenario {scenario.name} has no such robot; one of: {known}")


def _tokens(layout: KeyLayout, robot: LabRobot) -> tuple[str, ...]:
    told = [(True, robot.cmd_vel), (True, topics.DIAGNOSTICS), (False, robot.wanted), (False, topics.STOP)]
    ends = [
        Endpoint(SESSION, publishes, layout.within(layout.name(topic)), layout.types[topic], _NODE)
        for publishes, topic in told
    ]
    shown = [
        endpoint_token(layout, number, topic, end)
        for number, ((_, topic), end) in enumerate(zip(told, ends, strict=True), start=1)
    ]
    return (node_token(layout, SESSION, _NODE), *shown)
