"""What stands in for the truth where nobody knows it: both robots' tracks in the motion capture, smoothed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from estimation.calibration.smoothed_track import smoothed_motion, travelled_motion
from formation.angles import FloatArray
from formation.mount import Mount
from hil.judge.true_states import Stamps, TrueStates
from hil.log.reader import Log
from hil.scenario.leader_model import follower_mount, leader_mount
from hil.scenario.links import Link
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import MalformedPayloadError, to_ns

_LEAST = 20
_UPRIGHT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class MocapTracks:
    """Poses of both bodies by frame, (n, 3) x [m], y [m], theta [rad], at n increasing captures.

    ``capture_ns``: by the host's clock. theta is NaN where a body has no orientation.
    """

    capture_ns: Stamps
    leader: FloatArray
    follower: FloatArray


def tracks_of(log: Log, link: Link) -> MocapTracks | None:
    """Tracks of a follower and its predecessor in a log, None if it has hardly any frame of both."""
    if topics.RIGID_BODIES not in log.topics:
        return None
    rows = list(_rows(log, link.bodies))
    if len(rows) < _LEAST:
        return None
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    logged = np.array([row[1] for row in rows], dtype=np.int64)
    given = link.scenario.estimator
    if given.clock == "estimated":
        # The least delay is that of a frame which nothing held up, as the estimator's own clock has it.
        captured = stamps + (np.min(logged - stamps) - round(given.transport_latency_s * 1e9))
    else:
        captured = stamps - round(given.stamp_offset_s * 1e9)
    moments, first = np.unique(captured, return_index=True)
    poses = np.array([row[2] for row in rows], dtype=np.float64)[first]
    return MocapTracks(moments, poses[:, :3], poses[:, 3:])


def smoothed_truth(tracks: MocapTracks, scenario: Scenario) -> TrueStates:
    """States of both robots along their smoothed tracks, each frame's; NaN near an end and a gap.

    The leader's heading is that of its travel.
    """
    at_ns, slowest = tracks.capture_ns, slowest_travel(scenario)
    leads = travelled_motion(at_ns, _robots(tracks.leader, leader_mount(scenario)), at_ns, slowest)
    follows = smoothed_motion(at_ns, _robots(tracks.follower, follower_mount(scenario)), at_ns)
    return TrueStates.along(
        at_ns, np.column_stack([leads.poses, follows.poses, leads.motion, follows.motion])
    )


def slowest_travel(scenario: Scenario) -> float:
    """Speed [m/s] above which a leader is seen to travel."""
    return 0.5 * scenario.leader.v_eps


def _robots(bodies: FloatArray, mount: Mount) -> FloatArray:
    """Poses of the robot under a body; of a body without orientation its own places."""
    if not np.all(np.isfinite(bodies[:, 2])):
        return bodies
    theta = bodies[:, 2] - mount.yaw
    cos, sin = np.cos(theta), np.sin(theta)
    x = bodies[:, 0] - (cos * mount.x - sin * mount.y)
    y = bodies[:, 1] - (sin * mount.x + cos * mount.y)
    return np.column_stack([x, y, theta])


def _rows(log: Log, wanted: tuple[str, str]) -> Iterator[tuple[int, int, tuple[float, ...]]]:
    """Stamp, time of the record, and both poses of every frame that shows both bodies where they can be."""
    for record in log.records([topics.RIGID_BODIES]):
        try:
            frame = log.decode(record)
        except MalformedPayloadError:
            continue
        if not isinstance(frame, msg.RigidBodies):
            continue
        bodies = {each.rigid_body_name: each.pose for each in frame.rigidbodies}
        if not bodies.keys() >= set(wanted):
            continue
        poses = tuple(value for name in wanted for value in _planar(bodies[name]))
        # Where it stands must be known, and which way the follower looks.
        if all(map(math.isfinite, (*poses[:2], *poses[3:]))):
            yield to_ns(frame.header.stamp), record.log_ns, poses


def _planar(pose: msg.Pose) -> tuple[float, float, float]:
    q = pose.orientation
    x, y, z, w = q.x, q.y, q.z, q.w
    if not x * x + y * y + z * z + w * w > _UPRIGHT:
        return pose.position.x, pose.position.y, math.nan
    theta = math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return pose.position.x, pose.position.y, theta
