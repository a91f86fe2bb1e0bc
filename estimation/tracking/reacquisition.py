"""Re-acquisition: a tentative track out of rejected measurements, and the jump by which it takes over."""

from __future__ import annotations

import math

from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import mean_motion
from estimation.models.measurement import Measurement, way_between
from estimation.tracking.follower_check import FollowerCheck, carried, check_from, misfit
from estimation.tracking.track_point import JumpUncertainty, TentativeTrack
from formation.kernel import kernel
from formation.wrapping import wrapped

_NS = 1e-9


@kernel(inline=False)
def joined(
    tentative: TentativeTrack, measurement: Measurement, estimator: Filter, gate: float
) -> TentativeTrack:
    """Tentative track that a rejected measurement has joined, or a new one if the two do not agree.

    They agree if leader and follower are within the gate of where the tentative track has them. If they do
    not, the new one moves as from the last measurement to this: who is faster than any leader was said to be
    agrees with itself from the third on.
    """
    capture_ns, motion, follower = measurement.capture_ns, measurement.motion, measurement.seen.follower
    begun = estimator.start(measurement)
    if tentative.frames > 0:
        dt = (capture_ns - tentative.capture_ns) * _NS
        own = measurement.way if measurement.has_way else mean_motion(tentative.motion, motion)
        if measurement.anchored and tentative.framed:
            own = way_between(tentative.pose, follower, dt)
        stepped = estimator.step(tentative.belief, dt, own, measurement, gate)
        if stepped.nis <= gate and _follower_fits(tentative, measurement, dt, gate):
            return TentativeTrack(
                stepped.belief, capture_ns, motion, tentative.frames + 1, measurement.framed, follower
            )
        begun = estimator.begun_moving(measurement, stepped.belief, dt)
    return TentativeTrack(begun, capture_ns, motion, 1, measurement.framed, follower)


@kernel
def _follower_fits(tentative: TentativeTrack, measurement: Measurement, dt: float, gate: float) -> bool:
    if not (measurement.framed and tentative.framed):
        return True
    last = check_from(measurement)._replace(pose=tentative.pose)
    expected = carried(last, tentative.motion, measurement.motion, dt)
    return misfit(expected, measurement.seen.follower, measurement.noise) <= gate


@kernel
def jumped(
    jump: JumpUncertainty, measurement: Measurement, prior: Gaussian, check: FollowerCheck, leader_fits: bool
) -> JumpUncertainty:
    """Uncertainty with the jump added that leads from what was predicted to a measurement.

    A leader that fits its track has not jumped. A follower that fits the check has become its pose.
    """
    position, heading = jump.position, jump.heading
    if not leader_fits:
        dx, dy = measurement.x - prior.x, measurement.y - prior.y
        position += math.sqrt(dx * dx + dy * dy)
    if check.known and measurement.framed:
        pose = measurement.seen.follower
        dx, dy = pose.x - check.pose.x, pose.y - check.pose.y
        position += math.sqrt(dx * dx + dy * dy)
        heading += abs(wrapped(pose.theta - check.pose.theta))
    return JumpUncertainty(position, heading, measurement.capture_ns)


@kernel
def line_turn(jump: JumpUncertainty, measurement: Measurement) -> float:
    """Angle [rad] by which a jump may have turned the line from the follower to the leader, as measured."""
    x, y = measurement.x, measurement.y
    if measurement.in_world:
        x, y = x - measurement.seen.follower.x, y - measurement.seen.follower.y
    rho = math.sqrt(x * x + y * y)
    if rho > 0.0:
        return jump.heading + jump.position / rho
    return math.inf
