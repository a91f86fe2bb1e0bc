"""What goes wrong with a motion capture: faults put over the poses that it would have shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from formation.angles import wrap
from formation.pose import Pose
from hil.scenario.schema import FaultSection


@dataclass(frozen=True, slots=True)
class Pair:
    """Poses of both bodies in one frame."""

    leader: Pose
    follower: Pose


def is_active(fault: FaultSection, t: float, period: float) -> bool:
    """Whether a fault touches the frame at t [s]; one without duration touches just one frame of a period."""
    return fault.at_s <= t < fault.at_s + max(fault.duration_s, period)


def faulty(
    faults: Iterable[FaultSection], t: float, period: float, pair: Pair, last: Pair | None
) -> Pair | None:
    """Frame at t [s] under all faults of that moment, in their order; None for a frame that gets lost.

    ``last``: the frame shown before, which a frozen body repeats. ``period`` [s]: from frame to frame.
    """
    for fault in faults:
        if not is_active(fault, t, period):
            continue
        if fault.kind == "dropout":
            return None
        if fault.kind == "swap":
            pair = Pair(pair.follower, pair.leader)
            continue
        leader, follower = pair.leader, pair.follower
        if fault.body != "follower":
            leader = _moved(fault, leader, None if last is None else last.leader)
        if fault.body != "leader":
            follower = _moved(fault, follower, None if last is None else last.follower)
        pair = Pair(leader, follower)
    return pair


def _moved(fault: FaultSection, pose: Pose, last: Pose | None) -> Pose:
    if fault.kind == "freeze":
        return last or pose
    if fault.kind == "turn":
        return Pose(pose.x, pose.y, float(wrap(pose.theta + fault.angle)))
    dx, dy = fault.offset
    return Pose(pose.x + dx, pose.y + dy, pose.theta)
