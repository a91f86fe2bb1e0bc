"""A second track made of measurements that the first one rejected, and how far it is from the first."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.filters.belief import Belief
from estimation.filters.estimator import Estimator
from estimation.models.measurement import Measurement
from estimation.models.motion import FollowerMotion
from estimation.own_motion.inputs import mean_motion
from estimation.tracking.screening import Doubt, Watch, carried, misfit, watch_from
from formation.angles import wrap

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A second belief made of rejected measurements only, waiting for enough of them to agree."""

    belief: Belief
    capture_ns: int
    motion: FollowerMotion
    frames: int
    watch: Watch | None


def nursed(
    candidate: Candidate | None, measurement: Measurement, estimator: Estimator, gate: float
) -> Candidate:
    """Candidate that a rejected measurement has joined, or a new one if the two do not agree.

    They agree if leader and follower are within the gate of where the candidate has them.
    """
    capture_ns, motion, seen = measurement.capture_ns, measurement.motion, measurement.seen
    watch = None if seen is None else watch_from(seen)
    if candidate is not None:
        dt = (capture_ns - candidate.capture_ns) * _NS
        own = mean_motion(candidate.motion, motion)
        belief, nis = estimator.step(candidate.belief, dt, own, measurement, gate)
        if nis <= gate and _follower_fits(candidate, measurement, dt, gate):
            return Candidate(belief, capture_ns, motion, candidate.frames + 1, watch)
    return Candidate(estimator.start(measurement), capture_ns, motion, 1, watch)


def _follower_fits(candidate: Candidate, measurement: Measurement, dt: float, gate: float) -> bool:
    seen = measurement.seen
    if seen is None or candidate.watch is None:
        return True
    expected = carried(candidate.watch, candidate.motion, measurement.motion, dt)
    return misfit(expected, seen.follower, seen.noise) <= gate


def jump(
    doubt: Doubt, measurement: Measurement, foreseen: Belief, watch: Watch | None, *, leader_fits: bool
) -> Doubt:
    """Doubt with the jump added that leads from what was foreseen to a measurement.

    A leader that fits its track has not jumped. A follower that fits the watch has become its pose.
    """
    position, heading = doubt.position, doubt.heading
    if not leader_fits:
        dx, dy = (measurement.position - foreseen.mean[0:2]).tolist()
        position += math.hypot(dx, dy)
    if watch is not None and measurement.seen is not None:
        pose = measurement.seen.follower
        position += math.hypot(pose.x - watch.pose.x, pose.y - watch.pose.y)
        heading += abs(float(wrap(pose.theta - watch.pose.theta)))
    return Doubt(position, heading, measurement.capture_ns)


def turned(doubt: Doubt, measurement: Measurement) -> float:
    """Angle [rad] by which a doubt may have turned the line from the follower to the leader, as measured."""
    x, y = measurement.position.tolist()
    if measurement.pose is not None:
        x, y = x - measurement.pose.x, y - measurement.pose.y
    rho = math.hypot(x, y)
    return doubt.heading + (doubt.position / rho if rho > 0.0 else math.inf)
