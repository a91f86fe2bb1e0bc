"""How well the follower's own mocap track tells its motion, once the filter has settled."""

from __future__ import annotations

import math

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.own_track import OwnNoise, motion_of, own_begun, own_followed
from formation.pose import Pose

_NS = 1e-9
_SETTLING = 2.0  # seconds after which the filter's covariance no longer changes


def steady_noise(
    noise: OwnNoise, period: float, odometry: FollowerMotion | None = None
) -> tuple[float, float]:
    """Standard deviations of v [m/s] and u [rad/s] out of a track of poses that come every ``period`` [s].

    Those of a robot that drives straight on at half its speed, after two seconds; odometry of every pose's
    moment is fused in if its noise is given.
    """
    speed, period_ns = 0.5 * noise.v_max, round(period / _NS)
    has_odometry = odometry is not None
    sample = FollowerMotion(speed, 0.0, odometry.sd_v2, odometry.sd_u2) if odometry else _NOTHING
    point = own_begun(0, Pose(0.0, 0.0, 0.0), has_odometry, sample, noise)
    for k in range(1, max(2, math.ceil(_SETTLING / period))):
        pose = Pose(speed * k * period, 0.0, 0.0)
        point = own_followed(point, own_begun(k * period_ns, pose, has_odometry, sample, noise), noise)
    motion = motion_of(point)
    return motion.sd_v2, motion.sd_u2


_NOTHING = FollowerMotion(0.0, 0.0, 0.0, 0.0)
