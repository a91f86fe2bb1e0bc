"""What the estimator's node says of how its follower's body sits on the robot."""

from __future__ import annotations

import math

from estimation.tracking.mount_check import (
    NOTED_PLACE,
    NOTED_YAW,
    MountCheck,
    MountLeft,
    is_off,
    mount_left,
    surely_above,
)

_DEGREES, _MILLIMETRES = 180.0 / math.pi, 1e3


def mount_problem(check: MountCheck, *, stops: bool) -> str:
    """Why the follower is not to be driven; empty if it may be."""
    if not is_off(check):
        return ""
    what = "stopped" if stops else "driven all the same, as controller.mount_check is 'warn'"
    return f"{_yaw_text(mount_left(check))}: {what}; calibrate its mount"


def mount_report(check: MountCheck) -> dict[str, object]:
    """Values of a diagnostics message: what is left of the mount."""
    left = mount_left(check)
    if not left.known:
        return {}
    return {
        "mount.yaw_deg": round(left.yaw * _DEGREES, 3),
        "mount.yaw_sd_deg": round(left.sd_yaw * _DEGREES, 3),
        "mount.x_mm": round(left.place * _MILLIMETRES, 2),
        "mount.x_sd_mm": round(left.sd_place * _MILLIMETRES, 2),
    }


def mount_findings(check: MountCheck) -> dict[str, str]:
    """Findings, while what is left of the mount is worth a word."""
    left, found = mount_left(check), dict[str, str]()
    if not left.known:
        return found
    if surely_above(left.yaw, left.sd_yaw, NOTED_YAW):
        found["frame_yaw"] = f"{_yaw_text(left)}, expected 0"
    if surely_above(left.place, left.sd_place, NOTED_PLACE):
        found["frame_pivot"] = (
            f"the follower's body sits {left.place * _MILLIMETRES:+.1f} mm (sd "
            f"{left.sd_place * _MILLIMETRES:.1f}) further ahead of the wheel axis than follower.mount says, "
            "expected 0"
        )
    return found


def _yaw_text(left: MountLeft) -> str:
    return (
        f"the follower's heading is {left.yaw * _DEGREES:+.1f} deg (sd {left.sd_yaw * _DEGREES:.1f}) off its "
        "direction of travel"
    )
