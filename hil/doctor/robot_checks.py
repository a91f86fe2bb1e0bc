"""Checks of robots that nobody needs to move for: odometry, its clock, who listens, and who commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median

from hil.doctor.check import Check, check
from hil.doctor.evidence import Asked, Evidence, Rolled
from hil.nodes.findings import advice_on
from hil.nodes.listeners import listener_findings
from hil.wire.key_layout import KeyLayout
from hil.wire.lab_robots import LabRobot
from hil.wire.ros_tokens import Endpoint

_LEAST_HZ = 10.0
_MOST_OFFSET_S = 0.05
_OLDEST_S = 0.5


def robot_checks(found: Evidence, graph: Sequence[Endpoint], layout: KeyLayout) -> Iterator[Check]:
    """Checks of every robot. ``graph``: who publishes and who hears what, as far as it shows."""
    for robot in found.robots:
        rolled = found.odometry.get(robot.odom, [])
        yield _odometry(found, robot, rolled)
        if rolled:
            yield _odometry_clock(robot, rolled)
        yield from _listener(found, robot, graph, layout)
        yield _one_sender(found, robot, graph, layout)


def _odometry(found: Evidence, robot: LabRobot, rolled: Sequence[Rolled]) -> Check:
    unread = found.unread.get(robot.odom, 0)
    span_s = (rolled[-1].at_ns - rolled[0].at_ns) * 1e-9 if rolled else 0.0
    rate = (len(rolled) - 1) / span_s if span_s > 0.0 else 0.0
    seen = f"{robot.name}: {rate:.1f} samples a second on {robot.odom}"
    if unread:
        seen += f", {unread} that are no Odometry"
    return check(
        "odometry",
        rate >= _LEAST_HZ and not unread,
        seen,
        f"at least {_LEAST_HZ:g}",
        "start the robot and its bridge, and see that its namespace is the scenario's",
    )


def _odometry_clock(robot: LabRobot, rolled: Sequence[Rolled]) -> Check:
    age_s = median((each.at_ns - each.stamp_ns) * 1e-9 for each in rolled)
    stands = len({each.stamp_ns for each in rolled}) == 1 and len(rolled) > 1
    seen = f"{robot.name}: odometry is {age_s:.3f} s old when it comes"
    if stands:
        seen = f"{robot.name}: the stamps of its odometry stand still"
    ok = not stands and -_MOST_OFFSET_S <= age_s <= _OLDEST_S
    expected = f"between {-_MOST_OFFSET_S:g} and {_OLDEST_S:g} s"
    return check("odometry_clock", ok, seen, expected, "set the robot's clock by chrony, as of all machines")


def _listener(
    found: Evidence, robot: LabRobot, graph: Sequence[Endpoint], layout: KeyLayout
) -> Iterator[Check]:
    """Whether the robot hears its commands, where it shows in the graph at all, and as bridges see it.

    The leader may be deaf: who drives it by hand does.
    """
    told, odom = (layout.within(layout.name(topic)) for topic in (robot.cmd_vel, robot.odom))
    if not any(each.publishes and each.key == odom for each in graph):
        return
    heard_as = [each.typename for each in graph if not each.publishes and each.key == told]
    typename = layout.types[robot.cmd_vel]
    if robot == found.robots[0] and not heard_as:
        return
    wrong = listener_findings(f"/{layout.name(robot.cmd_vel)}", typename, heard_as)
    for name, text in wrong.items():
        yield Check(name, False, text, f"the robot listens for {typename}", advice_on(name))
    behind = any(f"/{layout.name(robot.cmd_vel)}" in text for _, text in found.reported_findings())
    if not wrong and not behind:
        yield Check("listens", True, f"{robot.name} listens to its commands", typename)


def _one_sender(found: Evidence, robot: LabRobot, graph: Sequence[Endpoint], layout: KeyLayout) -> Check:
    """Whether at most one commands the robot: by the graph, or by stamps that run back and forth."""
    topic = found.commands_to(robot)
    told = layout.within(layout.name(topic))
    senders = {each.session for each in graph if each.publishes and each.key == told}
    asked = found.commands.get(topic, [])
    mixed = len(senders) < 2 and _runs_back(asked)
    seen = f"{robot.name}: {len(senders)} senders of {topic} in the graph, {len(asked)} commands"
    if mixed:
        seen += ", whose stamps run back and forth"
    ok = len(senders) < 2 and not mixed
    return check("senders", ok, seen, "at most one", advice_on("second_sender"))


def _runs_back(asked: Sequence[Asked]) -> bool:
    stamps = [each.stamp_ns for each in asked if each.stamp_ns]
    return sum(after < before for before, after in pairwise(stamps)) > 2
