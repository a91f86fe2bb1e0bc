"""A robot that creeps ahead and turns on the spot, in rows: what is wrong with it shows in its own check."""

from __future__ import annotations

import math

import pytest

from formation.mount import NO_MOUNT, Mount, body_pose
from formation.pose import Motion, Pose
from hil.doctor.drive_checks import CREEP, CREEP_S, TURN, TURN_S, drive_checks
from hil.doctor.evidence import Evidence, Rolled, Seen
from hil.scenario.files import load_scenario

S = 1_000_000_000
HZ = 50
SPAN_NS = round(CREEP_S * S)
STANDS = Pose(1.0, 1.0, 0.3)
RIGHT = Motion(1.0, 1.0)


def driven(
    scale: Motion = RIGHT,
    mount: Mount = NO_MOUNT,
    known: Mount = NO_MOUNT,
    body: str = "follower",
    moves: bool = True,
    silent: bool = False,
) -> dict[str, str]:
    """Checks that fail of a follower with such odometry, and a body that sits so and is called so."""
    scenario = load_scenario("turtlebot3", [f"follower.mount={list(known)}"])
    found, other = Evidence(scenario), {"follower": "leader", "leader": "follower"}[body]
    for k in range(round((CREEP_S + TURN_S) * HZ) + 1):
        t, at_ns = k / HZ, k * S // HZ
        way, turn = CREEP.v * min(t, CREEP_S), TURN.u * max(0.0, t - CREEP_S)
        robot = Pose(way * math.cos(0.5), way * math.sin(0.5), 0.5 + turn) if moves else STANDS
        poses = {body: body_pose(robot, mount), other: STANDS}
        found.frames.append(Seen(at_ns, at_ns, k, tuple(poses), poses))
        told = CREEP if t < CREEP_S else TURN
        if not silent:
            motion = Motion(scale.v * told.v, scale.u * told.u)
            found.odometry.setdefault("follower/odom", []).append(Rolled(at_ns, at_ns, motion))
    robot_told = found.robots[1]
    checks = drive_checks(found, robot_told, (0, SPAN_NS - 1), (SPAN_NS, SPAN_NS + round(TURN_S * S)))
    return {each.name: each.seen for each in checks if not each.ok}


def test_nothing_is_wrong_with_what_is_right() -> None:
    assert driven() == {}


def test_a_mount_that_the_scenario_knows_is_none_that_is_wrong() -> None:
    mount = Mount(0.05, 0.02, 0.4)
    assert driven(mount=mount, known=mount) == {}


@pytest.mark.parametrize(
    ("wrong", "name", "word"),
    [
        ({"scale": Motion(-1.0, 1.0)}, "odometry_v2", "-1.0"),
        ({"scale": Motion(1.0, -1.0)}, "odometry_u2", "-1.0"),
        ({"scale": Motion(0.5, 1.0)}, "odometry_v2", "+0.5"),
        ({"scale": Motion(1.0, 0.0)}, "odometry_u2", "+0.0"),
        ({"silent": True}, "odometry_silent", "no odometry"),
        ({"mount": Mount(0.0, 0.0, 0.4)}, "frame_yaw", "+22.9 deg"),
        ({"mount": Mount(0.05, 0.0, 0.0)}, "frame_pivot", "50 mm"),
        ({"moves": False}, "deaf_robot", "0.00 m"),
        ({"body": "leader"}, "swapped", "body 'leader' went 0.15 m"),
    ],
)
def test_each_thing_that_is_wrong_is_named_alone(wrong: dict[str, object], name: str, word: str) -> None:
    found = driven(**wrong)  # type: ignore[arg-type]
    assert list(found) == [name]
    assert word in found[name]
