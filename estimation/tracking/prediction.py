"""Prediction of what was seen to the time at which a command will act."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from estimation.tracking.estimate import Estimate
from formation.angles import wrap
from formation.pose import Pose, advance
from formation.shape import Shape, shape_of

_NS = 1e-9
_LONGEST_ARC = 0.05


@dataclass(frozen=True, slots=True)
class SentCommand:
    """A command of speed v [m/s] and turn rate u [rad/s] that acts on the robot from ``from_ns`` on."""

    from_ns: int
    v: float
    u: float


def predict_shape(
    estimate: Estimate, commands: Sequence[SentCommand], until_ns: int, lag: float, further: float = 0.0
) -> Shape:
    """Shape of the pair at ``until_ns``, from the estimate at its capture time.

    The leader goes on with its estimated v1 and u1, and turns by ``further`` [rad], evenly on its way, beyond
    that (:meth:`estimation.tracking.foresight.Foresight.further`). The follower starts with its measured
    v2, u2 and follows the commands, given in order of time, through actuators of first-order ``lag`` [s];
    before the first of them it keeps its motion, after the last this one goes on.
    """
    follower = Pose(0.0, 0.0, 0.0)
    x, y = estimate.rho * math.cos(estimate.alpha2), estimate.rho * math.sin(estimate.alpha2)
    leader = Pose(x, y, wrap(estimate.alpha2 + math.pi - estimate.alpha1))
    total = (until_ns - estimate.capture_ns) * _NS
    if total <= 0.0:
        return Shape(estimate.rho, estimate.alpha1, estimate.alpha2)
    leader = advance(leader, estimate.v1, estimate.u1 + further / total, total)
    v, u = estimate.v2, estimate.u2
    for dt, command in _segments(estimate.capture_ns, until_ns, commands):
        goal_v, goal_u = (v, u) if command is None else (command.v, command.u)
        decay = math.exp(-dt / lag) if lag > 0.0 else 0.0
        share = (1.0 - decay) * lag / dt
        mean_v, mean_u = goal_v + (v - goal_v) * share, goal_u + (u - goal_u) * share
        follower = advance(follower, mean_v, mean_u, dt)
        v, u = goal_v + (v - goal_v) * decay, goal_u + (u - goal_u) * decay
    if leader.x == follower.x and leader.y == follower.y:
        return Shape(estimate.rho, estimate.alpha1, estimate.alpha2)
    return shape_of(leader, follower)


def _segments(
    from_ns: int, until_ns: int, commands: Sequence[SentCommand]
) -> list[tuple[float, SentCommand | None]]:
    """Durations [s] of constant command between two times, none longer than an arc may be."""
    segments: list[tuple[float, SentCommand | None]] = []
    at_ns: int = from_ns
    acting: SentCommand | None = None
    for command in [*commands, None]:
        end_ns = until_ns if command is None else min(command.from_ns, until_ns)
        if end_ns > at_ns:
            span = (end_ns - at_ns) * _NS
            pieces = math.ceil(span / _LONGEST_ARC)
            segments.extend([(span / pieces, acting)] * pieces)
            at_ns = end_ns
        acting = command
    return segments
