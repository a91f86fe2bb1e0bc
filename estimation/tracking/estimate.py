"""The estimate the follower acts on: shape, rates and leader motion, out of a belief in either frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.filters.ekf import spread_by, turned
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, Push
from estimation.models.measurement import Measurement
from estimation.models.motion import Matrix
from estimation.tracking.track_point import JumpUncertainty, TrackPoint
from formation.kernel import kernel
from formation.wrapping import wrapped

QUANTITIES = ("rho_dot", "alpha2_dot", "v1", "alpha1", "u1")
GUESSED = math.pi * math.pi / 3.0
"""Variance [rad^2] of an angle that may be any: uniform on the circle."""

_LEAST = 1e-9  # of a distance [m] or speed [m/s] that is divided by
_ROWS, _COLUMNS = np.triu_indices(len(QUANTITIES))


class Joint(NamedTuple):
    """Upper triangle by rows of the covariance of rho_dot (r), alpha2_dot (a), v1 (v), alpha1 (b), u1 (u)."""

    r_r: float
    r_a: float
    r_v: float
    r_b: float
    r_u: float
    a_a: float
    a_v: float
    a_b: float
    a_u: float
    v_v: float
    v_b: float
    v_u: float
    b_b: float
    b_u: float
    u_u: float


class Estimate(NamedTuple):
    """What the follower believes at ``capture_ns``, seen from its own body.

    rho [m], alpha2 [rad]; rho_dot [m/s], alpha2_dot [rad/s]; the leader's v1 [m/s], alpha1 [rad] and
    u1 [rad/s]; the follower's v2 [m/s], u2 [rad/s] it rests on.
    joint: covariance of :data:`QUANTITIES`. nis: of the newest measurement, nan for a first one.
    measured_ns: capture time of the newest measurement that was used. status: a :class:`~.tracker.Status`.
    jump: jumps that may be errors of the mocap; they are in the covariance.
    """

    capture_ns: int
    measured_ns: int
    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    v1: float
    alpha1: float
    u1: float
    v2: float
    u2: float
    joint: Joint
    nis: float
    status: int
    jump: JumpUncertainty

    @property
    def covariance(self) -> Matrix:
        """Covariance (5, 5) of :data:`QUANTITIES`."""
        matrix = np.empty((len(QUANTITIES), len(QUANTITIES)))
        matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = self.joint
        return matrix


class Slope(NamedTuple):
    """Derivative of a quantity by the leader's position and velocity along the follower's axes."""

    x: float
    y: float
    vx: float
    vy: float


class Sight(NamedTuple):
    """How the leader is seen: unit vector to it, distance, and relative velocity along and across that."""

    ex: float
    ey: float
    rho: float
    along: float
    across: float


@kernel
def estimate_at(point: TrackPoint, status: int) -> Estimate:
    """Estimate at a point of a track, its status being given.

    A follower's pose that was not believed gives way to the one that its own motion led to.
    """
    measurement = point.measurement
    if point.check.known:
        measurement = measurement._replace(seen=measurement.seen._replace(follower=point.check.pose))
    return estimate_of(point.belief, measurement, status, point.nis, point.used_ns, point.jump)


@kernel
def estimate_of(
    belief: Gaussian,
    measurement: Measurement,
    status: int,
    nis: float,
    measured_ns: int,
    jump: JumpUncertainty,
) -> Estimate:
    """Estimate at a measurement's capture time from the belief at that time.

    With e the unit vector to the leader, n its left normal, x the follower's heading and w the leader's
    velocity: rho_dot = e (w - v2 x), alpha2_dot = n (w - v2 x) / rho - u2, v1 = |w|, alpha1 the angle from
    w to -e. Inserted into Eq. (7) these give v1 and alpha1 again, whatever v2 and u2 are.
    """
    b, own = along_own_axes(belief, measurement, jump), measurement.motion
    rho, v1 = math.sqrt(b.x * b.x + b.y * b.y), math.sqrt(b.vx * b.vx + b.vy * b.vy)
    ex, ey = 1.0, 0.0
    if rho > 0.0:
        ex, ey = b.x / rho, b.y / rho
    safe = max(rho, _LEAST)
    ahead = b.vx - own.v2
    sight = Sight(ex, ey, safe, ex * ahead + ey * b.vy, ex * b.vy - ey * ahead)
    return Estimate(
        measurement.capture_ns,
        measured_ns,
        rho,
        math.atan2(b.y, b.x),
        sight.along,
        sight.across / safe - own.u2,
        v1,
        wrapped(math.atan2(-ey, -ex) - math.atan2(b.vy, b.vx)),
        b.u,
        own.v2,
        own.u2,
        joint_covariance(b, sight, own),
        nis,
        status,
        jump,
    )


@kernel
def guessed_when_slow(estimate: Estimate, v_eps: float) -> Estimate:
    """Estimate whose alpha1 is no better than a guess where the leader is slower than v_eps [m/s].

    Who hardly moves has no direction of travel worth the name: it may stand, turn on the spot, or turn back.
    More variance on the diagonal leaves the covariance positive semidefinite.
    """
    if estimate.v1 >= v_eps or estimate.joint.b_b >= GUESSED:
        return estimate
    return estimate._replace(joint=estimate.joint._replace(b_b=GUESSED))


@kernel
def guessed_if_standing(estimate: Estimate, standing: float) -> Estimate:
    """Estimate of a leader that stands by a probability: where it would drive to is then any guess.

    Its v1 is the mean of zero and of how fast it drives if it does, of which alpha1 has the deviation.
    """
    joint, drives = estimate.joint, 1.0 - standing
    own = drives * drives * joint.b_b
    return estimate._replace(
        joint=joint._replace(
            r_b=drives * joint.r_b,
            a_b=drives * joint.a_b,
            v_b=drives * joint.v_b,
            b_b=own + standing * max(0.0, GUESSED - own),
            b_u=drives * joint.b_u,
        )
    )


@kernel
def along_own_axes(belief: Gaussian, measurement: Measurement, jump: JumpUncertainty) -> Gaussian:
    """Belief along the follower's axes; a mocap pose brings its own noise into it, a jump what it may be.

    Noise and jump act alike: on the leader's place in every direction, and by the own heading on everything.
    """
    b = belief
    noise = measurement.noise
    if measurement.in_world:
        pose = measurement.seen.follower
        c, s = math.cos(pose.theta), math.sin(pose.theta)
        b = turned(b._replace(x=b.x - pose.x, y=b.y - pose.y), c, s)
    if measurement.in_world or measurement.anchored:
        b = _blurred(b, noise.position * noise.position, noise.heading * noise.heading)
    return _blurred(b, jump.position * jump.position, jump.heading * jump.heading)


@kernel
def _blurred(b: Gaussian, place: float, heading: float) -> Gaussian:
    """Belief with variances of the follower's place [m^2] and heading [rad^2] in it."""
    b = spread_by(b, heading, Push(b.y, -b.x, b.vy, -b.vx))
    return b._replace(x_x=b.x_x + place, y_y=b.y_y + place)


@kernel
def _slopes(b: Gaussian, sight: Sight) -> tuple[Slope, Slope, Slope, Slope]:
    """Derivatives of rho_dot, alpha2_dot, v1 and alpha1."""
    ex, ey, rho = sight.ex, sight.ey, sight.rho
    nx, ny = -ey, ex
    speed = max(math.sqrt(b.vx * b.vx + b.vy * b.vy), _LEAST)
    turning, closing = sight.across / rho, 1.0 / (rho * rho)
    squared = speed * speed
    return (
        Slope(nx * turning, ny * turning, ex, ey),
        Slope(
            -(nx * sight.along + ex * sight.across) * closing,
            -(ny * sight.along + ey * sight.across) * closing,
            nx / rho,
            ny / rho,
        ),
        Slope(0.0, 0.0, b.vx / speed, b.vy / speed),
        Slope(nx / rho, ny / rho, b.vy / squared, -b.vx / squared),
    )


@kernel
def _by(b: Gaussian, g: Slope) -> Slope:
    """Covariance of a quantity of this slope with position and velocity."""
    return Slope(
        g.x * b.x_x + g.y * b.x_y + g.vx * b.x_vx + g.vy * b.x_vy,
        g.x * b.x_y + g.y * b.y_y + g.vx * b.y_vx + g.vy * b.y_vy,
        g.x * b.x_vx + g.y * b.y_vx + g.vx * b.vx_vx + g.vy * b.vx_vy,
        g.x * b.x_vy + g.y * b.y_vy + g.vx * b.vx_vy + g.vy * b.vy_vy,
    )


@kernel
def _with_turn(b: Gaussian, g: Slope) -> float:
    """Covariance of a quantity of this slope with the leader's turn rate."""
    return g.x * b.x_u + g.y * b.y_u + g.vx * b.vx_u + g.vy * b.vy_u


@kernel
def _dot(a: Slope, b: Slope) -> float:
    return a.x * b.x + a.y * b.y + a.vx * b.vx + a.vy * b.vy


@kernel
def joint_covariance(b: Gaussian, sight: Sight, own: FollowerMotion) -> Joint:
    """Covariance of :data:`QUANTITIES` of a belief along the follower's axes, the errors of v2, u2 in it."""
    r, a, v, w = _slopes(b, sight)
    by_r, by_a, by_v, by_w = _by(b, r), _by(b, a), _by(b, v), _by(b, w)
    speed, turn = own.sd_v2 * own.sd_v2, own.sd_u2 * own.sd_u2
    # What v2 and u2 do to the two rates: (-e x, 0) and (-n x / rho, -1).
    closing, turning = -sight.ex, sight.ey / sight.rho
    return Joint(
        _dot(by_r, r) + speed * closing * closing,
        _dot(by_r, a) + speed * closing * turning,
        _dot(by_r, v),
        _dot(by_r, w),
        _with_turn(b, r),
        _dot(by_a, a) + speed * turning * turning + turn,
        _dot(by_a, v),
        _dot(by_a, w),
        _with_turn(b, a),
        _dot(by_v, v),
        _dot(by_v, w),
        _with_turn(b, v),
        _dot(by_w, w),
        _with_turn(b, w),
        b.u_u,
    )
