"""What the follower measures of the leader, with noise that follows the geometry.

Two front ends: *world* (mocap gives the leader's position and the follower's pose) and *body* (range and
bearing of the leader seen from the follower, and the follower's own motion).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from estimation.models.motion import FollowerMotion, Matrix, Vector
from formation.pose import Pose

_UNIT = np.eye(2)


class FrontEnd(Enum):
    """In which frame the leader is tracked."""

    WORLD = "world"
    BODY = "body"


@dataclass(frozen=True, slots=True)
class PoseNoise:
    """Standard deviations of a mocap pose: position [m] per axis, heading [rad]."""

    position: float
    heading: float


@dataclass(frozen=True, slots=True)
class PairSeen:
    """Both robots as one mocap frame shows them: the leader's position [m], the follower's pose."""

    leader: tuple[float, float]
    follower: Pose
    noise: PoseNoise


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The leader's position at one capture time, and what belongs to that moment.

    position: (2,) [m], in the mocap frame or in the follower's body frame.
    covariance: (2, 2) [m^2] of the position.
    motion: the follower's measured motion at the capture time.
    pose, pose_noise: the follower's mocap pose; None for the body front end.
    seen: the mocap frame that all of this comes from, in either front end; None for a sighting.
    """

    capture_ns: int
    position: Vector
    covariance: Matrix
    motion: FollowerMotion
    pose: Pose | None = None
    pose_noise: PoseNoise | None = None
    seen: PairSeen | None = None


def measure_world(
    capture_ns: int, leader: tuple[float, float], follower: Pose, noise: PoseNoise, motion: FollowerMotion
) -> Measurement:
    """World front end: the leader's mocap position, with covariance sigma_p^2 I."""
    covariance = noise.position**2 * _UNIT
    seen = PairSeen(leader, follower, noise)
    return Measurement(capture_ns, np.array(leader), covariance, motion, follower, noise, seen)


def from_sensor(rho: float, alpha2: float, place: tuple[float, float]) -> tuple[float, float]:
    """Range [m] and bearing [rad] from the follower's wheel axis, out of those from a sensor's place.

    place: [m] ahead of the axis' middle and to the left of it; the sensor's axes are the follower's.
    """
    x, y = place[0] + rho * math.cos(alpha2), place[1] + rho * math.sin(alpha2)
    return math.hypot(x, y), math.atan2(y, x)


def measure_body(
    capture_ns: int, rho: float, alpha2: float, sd_rho: float, sd_alpha2: float, motion: FollowerMotion
) -> Measurement:
    """Body front end: range and bearing turned into a position along the follower's axes.

    The covariance is diag(sd_rho^2, (rho sd_alpha2)^2) along and across the line of sight.
    """
    cos_a, sin_a = math.cos(alpha2), math.sin(alpha2)
    rotation = np.array([[cos_a, -sin_a], [sin_a, cos_a]])
    spread = rotation * np.array([sd_rho, rho * sd_alpha2])
    return Measurement(capture_ns, rho * rotation[:, 0], spread @ spread.T, motion)


def measure_body_from_mocap(
    capture_ns: int, leader: tuple[float, float], follower: Pose, noise: PoseNoise, motion: FollowerMotion
) -> Measurement:
    """Body front end fed by mocap.

    var(rho) = 2 sigma_p^2, var(alpha2) = 2 sigma_p^2 / rho^2 + sigma_heading^2.
    """
    dx, dy = leader[0] - follower.x, leader[1] - follower.y
    rho, alpha2 = math.hypot(dx, dy), math.atan2(dy, dx) - follower.theta
    sd_rho = math.sqrt(2.0) * noise.position
    sd_alpha2 = math.hypot(sd_rho / rho, noise.heading)
    measured = measure_body(capture_ns, rho, alpha2, sd_rho, sd_alpha2, motion)
    return replace(measured, seen=PairSeen(leader, follower, noise))
