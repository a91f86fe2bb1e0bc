"""What the estimator's node says of how bodies sit on their robots."""

from __future__ import annotations

import math

from estimation.tracking.mount_check import (
    NO_MOUNT_CHECK,
    NOTED_PLACE,
    NOTED_YAW,
    MountCheck,
    MountLeft,
    mount_left,
    surely_above,
)
from estimation.tracking.sideways_check import NO_SIDEWAYS_CHECK, SidewaysCheck, sideways_left

_DEGREES, _MILLIMETRES = 180.0 / math.pi, 1e3


def mount_problem(check: MountCheck, *, stops: bool) -> str:
    """Why the follower is not to be driven; empty if it may be."""
    if not check.off:
        return ""
    what = "stopped" if stops else "driven all the same, as controller.mount_check is 'warn'"
    return f"{_yaw_text(mount_left(check))}: {what}; calibrate its mount"


def mount_report(
    check: MountCheck, leader: MountCheck = NO_MOUNT_CHECK, sideways: SidewaysCheck = NO_SIDEWAYS_CHECK
) -> dict[str, object]:
    """Values of a diagnostics message: what is left of the mounts; ``sideways``: of the follower's."""
    values: dict[str, object] = {}
    for prefix, each in (("mount.", check), ("mount.leader_", leader)):
        left = mount_left(each)
        if left.known:
            values |= {
                f"{prefix}yaw_deg": round(left.yaw * _DEGREES, 3),
                f"{prefix}yaw_sd_deg": round(left.sd_yaw * _DEGREES, 3),
                f"{prefix}x_mm": round(left.place * _MILLIMETRES, 2),
                f"{prefix}x_sd_mm": round(left.sd_place * _MILLIMETRES, 2),
            }
    if (aside := sideways_left(sideways)) is not None:
        values |= {
            "mount.y_mm": round(aside[0] * _MILLIMETRES, 2),
            "mount.y_sd_mm": round(aside[1] * _MILLIMETRES, 2),
        }
    return values


def mount_findings(
    check: MountCheck, leader: MountCheck = NO_MOUNT_CHECK, sideways: SidewaysCheck = NO_SIDEWAYS_CHECK
) -> dict[str, str]:
    """Findings, while what is left of the mounts is worth a word; ``sideways``: of the follower's."""
    yaws, pivots = list[str](), list[str]()
    for robot, each in (("follower", check), ("leader", leader)):
        left = mount_left(each)
        if left.known and surely_above(left.yaw, left.sd_yaw, NOTED_YAW):
            yaws.append(f"{_yaw_text(left, robot)}, expected 0")
        if left.known and surely_above(left.place, left.sd_place, NOTED_PLACE):
            pivots.append(_pivot_text(robot, left.place, left.sd_place, "further ahead of the wheel axis"))
    aside, own = sideways_left(sideways), mount_left(check)
    # By a heading that is off, speed along it is no speed of the wheels.
    straight = not (own.known and surely_above(own.yaw, own.sd_yaw, NOTED_YAW))
    if aside is not None and straight and surely_above(*aside, NOTED_PLACE):
        pivots.append(_pivot_text("follower", *aside, "further left of the wheels' middle"))
    named = {"frame_yaw": yaws, "frame_pivot": pivots}
    return {name: "; ".join(texts) for name, texts in named.items() if texts}


def _pivot_text(robot: str, place: float, sd: float, where: str) -> str:
    return (
        f"the {robot}'s body sits {place * _MILLIMETRES:+.1f} mm (sd {sd * _MILLIMETRES:.1f}) {where} than "
        f"{robot}.mount says, expected 0"
    )


def _yaw_text(left: MountLeft, robot: str = "follower") -> str:
    return (
        f"the {robot}'s heading is {left.yaw * _DEGREES:+.1f} deg (sd {left.sd_yaw * _DEGREES:.1f}) off its "
        "direction of travel"
    )
