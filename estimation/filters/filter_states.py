"""Filter states: what some estimators know beyond mean and covariance, plain data in the belief."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.motion import Matrix, Vector
from formation.pose import Pose


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """What a first guess of the leader's velocity is made of: an earlier position, and how it has aged.

    anchor: (2,) [m], in the frame of the front end; covariance: (2, 2) [m^2]. elapsed [s] since it was
    measured. drift [m]: how far the follower's own motion may have carried it wrongly. samples: since then.
    """

    anchor: Vector
    covariance: Matrix
    elapsed: float = 0.0
    drift: float = 0.0
    samples: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class ShapeState:
    """State (5,) ``[rho, alpha1, alpha2, v1, u1]`` with its covariance (5, 5), SI units and radians.

    pose: where the follower is believed to be, for the world front end; heading_noise [rad] and
    position_noise [m] are those of the pose.
    """

    state: Vector
    covariance: Matrix
    pose: Pose | None = None
    position_noise: float = 0.0
    heading_noise: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One moment of a window: how long after the one before [s], and how the follower moved in between.

    drive: covariance (5, 5) that the motion since then adds. state: (5,), where the problem is linearised.
    seen: (2,) [m], the leader's position, with its covariance noise (2, 2) [m^2]; None without a measurement.
    """

    dt: float
    follower: FollowerMotion
    drive: Matrix
    state: Vector
    seen: Vector | None = None
    noise: Matrix | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Horizon:
    """The window of a moving-horizon estimator: its moments, and what all before says of the first of them.

    mean (5,) and covariance (5, 5): the arrival cost, without the measurement of the first moment.
    """

    mean: Vector
    covariance: Matrix
    stages: tuple[Stage, ...]


@dataclass(frozen=True, slots=True)
class Excitation:
    """How much a pair has moved against each other of late, as weighted sums over its moments.

    In the frame along the leader's velocity: ``sight`` of the unit vectors to the leader, ``own`` of the
    follower's velocities [m/s], both as x + iy; ``own_squared`` of their squared lengths;
    ``direction_variance`` of the variances [rad^2] with which the leader's direction was known.
    """

    weight: float = 0.0
    sight: complex = 0.0
    own: complex = 0.0
    own_squared: float = 0.0
    direction_variance: float = 0.0

    @property
    def sd_direction(self) -> float:
        """Root mean square [rad] of how well the leader's direction was known; infinite without a moment."""
        return math.sqrt(self.direction_variance / self.weight) if self.weight > 0.0 else math.inf

    @property
    def sight_spread(self) -> float:
        """Standard deviation [rad] of the direction alpha1; to first order."""
        if self.weight <= 0.0:
            return 0.0
        return math.sqrt(max(0.0, 1.0 - abs(self.sight / self.weight) ** 2))

    @property
    def own_spread(self) -> float:
        """Standard deviation of the follower's velocity as a share of its root mean square."""
        if self.own_squared <= 0.0:
            return 0.0
        return math.sqrt(max(0.0, 1.0 - abs(self.own) ** 2 / (self.weight * self.own_squared)))


@dataclass(frozen=True, slots=True, eq=False)
class SensorOffsets:
    """Offsets (2,) of a sensor's range [m] and bearing [rad], measured minus true.

    covariance: (2, 2). cross: (5, 2), with the leader's states. range_observable, bearing_observable: whether
    the pair moves so that they can be told; until then they are left as they are.
    """

    mean: Vector
    covariance: Matrix
    cross: Matrix
    excitation: Excitation = Excitation()
    range_observable: bool = False
    bearing_observable: bool = False
