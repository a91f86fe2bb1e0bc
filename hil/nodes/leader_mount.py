"""What the estimator's node sees of how the leader's body sits on its robot.

The leader's orientation, where it has one, is looked at here for a word in the diagnostics, and reaches
neither an estimate nor a command.
"""

from __future__ import annotations

from typing import NamedTuple

from estimation.models.measurement import PoseNoise
from estimation.tracking.mount_check import NO_MOUNT_CHECK, MountCheck, mount_checked
from formation.mount import Mount, robot_pose
from formation.pose import Pose


class LeaderMountWatch(NamedTuple):
    """Check of the leader's mount. ``begun`` with a heading, ``first``; one that never changes is none."""

    check: MountCheck = NO_MOUNT_CHECK
    begun: bool = False
    first: float = 0.0
    turns: bool = False


UNWATCHED = LeaderMountWatch()


def with_leader(
    watch: LeaderMountWatch, capture_ns: int, body: Pose, mount: Mount, noise: PoseNoise
) -> LeaderMountWatch:
    """Watch with the newest pose of the leader's body, of which ``mount`` is known."""
    if not watch.begun:
        return watch._replace(begun=True, first=body.theta)
    if not watch.turns and body.theta == watch.first:
        return watch
    check = mount_checked(watch.check, capture_ns, robot_pose(body, mount), noise, False)
    return watch._replace(check=check, turns=True)
