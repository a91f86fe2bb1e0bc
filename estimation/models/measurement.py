"""What the follower measures of the leader, with noise that follows the geometry.

Two front ends: *world* (mocap gives the leader's position and the follower's pose) and *body* (range and
bearing of the leader seen from the follower, and the follower's own motion).
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from estimation.models.coordinated_turn import FollowerMotion, Spread
from estimation.models.motion import Matrix, Vector
from formation.arc import small_turn
from formation.kernel import kernel
from formation.pose import Pose
from formation.wrapping import wrapped

NO_MOTION = FollowerMotion(0.0, 0.0, 0.0, 0.0)


class FrontEnd(Enum):
    """In which frame the leader is tracked."""

    WORLD = "world"
    BODY = "body"


class PoseNoise(NamedTuple):
    """Standard deviations of a mocap pose: position [m] per axis, heading [rad]."""

    position: float
    heading: float


class PairSeen(NamedTuple):
    """Both robots as one mocap frame shows them: the leader's position [m], the follower's pose."""

    leader_x: float
    leader_y: float
    follower: Pose


class Measurement(NamedTuple):
    """The leader's position at one capture time, and what belongs to that moment.

    x, y: [m], in the mocap frame, or along the follower's axes. spread: their covariance [m^2].
    motion: the follower's measured motion at the capture time.
    in_world: whether x and y are mocap's; the follower's pose is then that of ``seen``.
    framed: whether all this comes from a mocap frame, which is ``seen``, or from a sighting.
    noise: of the pose in ``seen``.
    has_way, way: the follower's mean motion since the measurement before, where more of it is known than what
    it was at both ends. anchored: x and y are along the axes of the *measured* pose, so that poses tell the
    way between two of them without error, and the noise of the pose is not in the spread.
    """

    capture_ns: int
    x: float
    y: float
    spread: Spread
    motion: FollowerMotion
    in_world: bool
    framed: bool
    seen: PairSeen
    noise: PoseNoise
    has_way: bool = False
    way: FollowerMotion = NO_MOTION
    anchored: bool = False

    @staticmethod
    def at(capture_ns: int, position: Vector, covariance: Matrix, motion: FollowerMotion) -> Measurement:
        """Sighting of a position (2,) [m] with its covariance (2, 2) [m^2], along the follower's axes."""
        (x, y), ((xx, xy), (_, yy)) = position.tolist(), covariance.tolist()
        noise, seen = PoseNoise(0.0, 0.0), PairSeen(0.0, 0.0, Pose(0.0, 0.0, 0.0))
        return Measurement(capture_ns, x, y, Spread(xx, xy, yy), motion, False, False, seen, noise)

    @property
    def position(self) -> Vector:
        """Position (2,) [m]."""
        return np.array([self.x, self.y])

    @property
    def covariance(self) -> Matrix:
        """Covariance (2, 2) [m^2] of the position."""
        xx, xy, yy = self.spread
        return np.array([[xx, xy], [xy, yy]])

    @property
    def pose(self) -> Pose | None:
        """The follower's mocap pose; None for the body front end."""
        return self.seen.follower if self.in_world else None

    @property
    def pose_noise(self) -> PoseNoise | None:
        """Noise of the pose; None for the body front end."""
        return self.noise if self.in_world else None


@kernel
def measure_world(
    capture_ns: int, leader: tuple[float, float], follower: Pose, noise: PoseNoise, motion: FollowerMotion
) -> Measurement:
    """World front end: the leader's mocap position, with covariance sigma_p^2 I."""
    variance = noise.position * noise.position
    still = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    spread, seen = Spread(variance, 0.0, variance), PairSeen(leader[0], leader[1], follower)
    return Measurement(
        capture_ns, leader[0], leader[1], spread, motion, True, True, seen, noise, False, still, False
    )


@kernel
def from_sensor(rho: float, alpha2: float, place: tuple[float, float]) -> tuple[float, float]:
    """Range [m] and bearing [rad] from the follower's wheel axis, out of those from a sensor's place.

    place: [m] ahead of the axis' middle and to the left of it; the sensor's axes are the follower's.
    """
    x, y = place[0] + rho * math.cos(alpha2), place[1] + rho * math.sin(alpha2)
    return math.sqrt(x * x + y * y), math.atan2(y, x)


@kernel
def spread_of_sight(cos: float, sin: float, along: float, across: float) -> Spread:
    """Covariance of a position whose variances are given along a line of sight and across it."""
    return Spread(
        cos * cos * along + sin * sin * across,
        cos * sin * (along - across),
        sin * sin * along + cos * cos * across,
    )


@kernel
def measure_body(
    capture_ns: int, rho: float, alpha2: float, sd_rho: float, sd_alpha2: float, motion: FollowerMotion
) -> Measurement:
    """Body front end: range and bearing turned into a position along the follower's axes.

    The covariance is diag(sd_rho^2, (rho sd_alpha2)^2) along and across the line of sight.
    """
    cos, sin, sd_across = math.cos(alpha2), math.sin(alpha2), rho * sd_alpha2
    spread = spread_of_sight(cos, sin, sd_rho * sd_rho, sd_across * sd_across)
    still = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    noise, seen = PoseNoise(0.0, 0.0), PairSeen(0.0, 0.0, Pose(0.0, 0.0, 0.0))
    return Measurement(
        capture_ns, rho * cos, rho * sin, spread, motion, False, False, seen, noise, False, still, False
    )


@kernel
def measure_body_from_mocap(
    capture_ns: int, leader: tuple[float, float], follower: Pose, noise: PoseNoise, motion: FollowerMotion
) -> Measurement:
    """Body front end fed by mocap; the robots must not be in one place.

    var(rho) = 2 sigma_p^2, var(alpha2) = 2 sigma_p^2 / rho^2 + sigma_heading^2.
    """
    dx, dy = leader[0] - follower.x, leader[1] - follower.y
    cos, sin = math.cos(follower.theta), math.sin(follower.theta)
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    squared = x * x + y * y
    rho = math.sqrt(squared)
    along = 2.0 * noise.position * noise.position
    across = along + squared * noise.heading * noise.heading
    spread = spread_of_sight(x / rho, y / rho, along, across)
    still = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    seen = PairSeen(leader[0], leader[1], follower)
    return Measurement(capture_ns, x, y, spread, motion, False, True, seen, noise, False, still, False)


@kernel
def measure_body_anchored(
    capture_ns: int, leader: tuple[float, float], follower: Pose, noise: PoseNoise, motion: FollowerMotion
) -> Measurement:
    """The same along the axes of the pose as it was measured: its heading's noise turns all there is alike.

    What is left is that of both positions, 2 sigma_p^2 in every direction.
    """
    level = PoseNoise(noise.position, 0.0)
    measured = measure_body_from_mocap(capture_ns, leader, follower, level, motion)
    return measured._replace(noise=noise, anchored=True)


@kernel
def seen_in_range(measurement: Measurement) -> Measurement:
    """A measurement along the follower's axes whose range counts, its bearing being off by a radian."""
    x, y, spread = measurement.x, measurement.y, measurement.spread
    return measurement._replace(spread=Spread(spread.xx + y * y, spread.xy - x * y, spread.yy + x * x))


@kernel
def way_between(before: Pose, after: Pose, dt: float) -> FollowerMotion:
    """Mean motion that leads from one pose to another in dt [s], as if there were no error in either."""
    turn, dx, dy = wrapped(after.theta - before.theta), after.x - before.x, after.y - before.y
    middle = before.theta + 0.5 * turn
    chord = dx * math.cos(middle) + dy * math.sin(middle)
    return FollowerMotion(chord / (small_turn(0.5 * turn).sinc * dt), turn / dt, 0.0, 0.0)
