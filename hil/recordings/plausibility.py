"""What does not look right of a recording's poses: their unit, their axes, a leader beyond its limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formation.angles import FloatArray
from hil.recordings.pair_log import Recorded, Times, known_rows
from hil.scenario.schema import Scenario

_FAR_M = 50.0
_NEAR_M = 0.01
_STEP_NS = 500_000_000
_BEYOND = 1.2
_TILTED_DEG = 30.0  # what messages are refused by


def doubts(recorded: Recorded, scenario: Scenario) -> tuple[str, ...]:
    """What does not look right, a line each, with what to do."""
    return (
        *_distance(recorded),
        *_tilt(recorded),
        *_speed(recorded, scenario),
        *_turning(recorded, scenario),
    )


def _distance(recorded: Recorded) -> Iterator[str]:
    if recorded.leader is None or recorded.follower is None:
        return
    apart = np.linalg.norm(recorded.leader[:, :3] - recorded.follower[:, :3], axis=1)
    apart = apart[np.isfinite(apart)]
    if not apart.size:
        yield "leader and follower are never seen at once"
        return
    middle = float(np.median(apart))
    if middle > _FAR_M:
        yield f'the robots are {middle:.4g} m apart: if positions are in mm, map them with unit = "mm"'
    elif middle < _NEAR_M:
        yield f"the robots are {1000.0 * middle:.2g} mm apart: see that they are two, and in meters"


def _tilt(recorded: Recorded) -> Iterator[str]:
    for role, poses in (("leader", recorded.leader), ("follower", recorded.follower)):
        if poses is None or not known_rows(poses).any():
            continue
        qx, qy = poses[known_rows(poses), 3:5].T
        up = float(np.median(1.0 - 2.0 * (qx * qx + qy * qy)))
        tilt = float(np.degrees(np.arccos(np.clip(up, -1.0, 1.0))))
        if tilt > _TILTED_DEG:
            yield (
                f"the {role} is tilted by {tilt:.0f} degrees, and frames are refused: see which axis is "
                "up, and set the body's orientation anew where it stands level"
            )


def _speed(recorded: Recorded, scenario: Scenario) -> Iterator[str]:
    if recorded.leader is None:
        return
    seen = known_rows(recorded.leader)
    fastest = fast_speed(recorded.t_ns[seen], recorded.leader[seen, :2])
    if fastest > _BEYOND * scenario.leader.k_v:
        yield (
            f"the leader drives at {fastest:.2g} m/s, leader.k_v is {scenario.leader.k_v:g}: "
            f"add --set leader.k_v={_BEYOND * fastest:.2g}"
        )


def _turning(recorded: Recorded, scenario: Scenario) -> Iterator[str]:
    if recorded.leader is None:
        return
    seen = known_rows(recorded.leader)
    hardest = hard_turn(recorded.t_ns[seen], recorded.leader[seen])
    if hardest > _BEYOND * scenario.leader.k_u:
        yield (
            f"the leader turns at {hardest:.2g} rad/s, leader.k_u is {scenario.leader.k_u:g}: "
            f"add --set leader.k_u={_BEYOND * hardest:.2g}"
        )


def hard_turn(t_ns: Times, placements: FloatArray) -> float:
    """Turn rate [rad/s] over half a second that nineteen in twenty rows keep below; 0 for a shorter track.

    Of bodies without an orientation, whose quaternions do not turn, it is 0.
    """
    qx, qy, qz, qw = placements[:, 3:7].T
    heading = np.unwrap(np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)))
    return _fast(t_ns, heading[:, np.newaxis])


def fast_speed(t_ns: Times, positions: FloatArray) -> float:
    """Speed [m/s] over half a second that nineteen in twenty rows keep below; 0 for a shorter track."""
    return _fast(t_ns, positions)


def _fast(t_ns: Times, places: FloatArray) -> float:
    after = np.searchsorted(t_ns, t_ns + _STEP_NS)
    first = np.flatnonzero(after < len(t_ns))
    if not first.size:
        return 0.0
    last = after[first]
    way = np.linalg.norm(places[last] - places[first], axis=1)
    return float(np.percentile(way / ((t_ns[last] - t_ns[first]) * 1e-9), 95.0))
