"""Tracks of a pair in arrays, fed to the estimator's node row by row as if they came over the wire."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray
from formation.pose import Motion, Pose
from formation.records import Rows, rows_of, store
from hil.emulator.entries import tell_frame, tell_odometry
from hil.emulator.lab_messages import MOCAP_FRAME, odometry_frames
from hil.emulator.mocap import SeenPose, seen_pose
from hil.emulator.world import Odometry
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.nodes.node import Counts, Outgoing
from hil.replay.smoothing import ListeningEstimator, smoothed_estimates
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.cdr import STAMP_BYTES, aligned
from hil.wire.events import Event
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import to_ns
from hil.wire.templates import frame_template, odometry_template
from hil.wire.topics import topics_of

_SEEN, _ELEMENTS = 2 + len(QUANTITIES), len(QUANTITIES) ** 2
_NUMBERS = struct.Struct(f"<{_SEEN}d16x{_ELEMENTS}d8xB")
"""From rho to the status, without v2, u2 and the NIS."""
_BOUNDS = struct.Struct("<3d")


@dataclass(frozen=True, slots=True, eq=False)
class PoseTracks:
    """What was measured of a pair at n increasing times; a row with a NaN was not seen.

    ``t_ns`` (n,), ``leader`` (n, 2): x, y [m], ``follower`` (n, 3): x, y [m], theta [rad], ``motion`` (n, 2):
    the follower's v2 [m/s] and u2 [rad/s], None where its odometry is not known.
    """

    t_ns: NDArray[np.int64]
    leader: FloatArray
    follower: FloatArray
    motion: FloatArray | None = None


class ToldEstimate(NamedTuple):
    """Numbers of an estimate's message: ``seen`` rho, alpha2 and the five quantities, ``variances`` of these.

    ``bounds`` of v1, alpha1 and h. Units and signs as in ``LeaderEstimate.msg``.
    """

    status: int
    reason: str
    seen: tuple[float, ...]
    variances: tuple[float, ...]
    bounds: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TrackEstimates:
    """For every row the estimate that it led to, or None, and then why: the cause by which it was refused.

    The reason is empty for a row that was not seen. ``refused``: all that was, by cause, odometry too.
    """

    estimates: tuple[ToldEstimate | None, ...]
    reasons: tuple[str, ...]
    refused: Counts


def estimates_of_tracks(tracks: PoseTracks, scenario: Scenario) -> TrackEstimates:
    """Estimates of a scenario's estimator, each frame come and taken at the time at which it was captured.

    Where the node would speak up between frames it is not asked. Raises :class:`UsageError` as the node does.
    """
    if scenario.estimator.kind == "smoother":
        listening = ListeningEstimator(scenario)
        fed = _fed(listening, tracks)
        smoothed_ones = smoothed_estimates(listening).estimates
        by_capture = {to_ns(each.header.stamp): told_by(each) for each in smoothed_ones}
        smoothed = tuple(by_capture.get(at_ns) for at_ns in tracks.t_ns.tolist())
        return TrackEstimates(smoothed, fed.reasons, fed.refused)
    return _fed(EstimatorNode(scenario), tracks)


def _fed(node: EstimatorNode, tracks: PoseTracks) -> TrackEstimates:
    feed, times = _Feed(tracks, node.scenario), tracks.t_ns.tolist()
    state = node.begin(times[0])
    estimates: list[ToldEstimate | None] = []
    reasons: list[str] = []
    for k, now_ns in enumerate(times):
        if feed.moved[k]:
            state, _ = node.step(state, feed.odometry(k), now_ns)
        made, reason = _taken(node, state, feed.frame(k), now_ns) if feed.seen[k] else (None, "")
        estimates.append(made)
        reasons.append(reason)
    return TrackEstimates(tuple(estimates), tuple(reasons), state.refused)


def _taken(
    node: EstimatorNode, state: EstimatorState, frame: Event, now_ns: int
) -> tuple[ToldEstimate | None, str]:
    """What a frame led to."""
    before = state.refused
    _, sent = node.step(state, frame, now_ns)
    if sent:
        return _estimate_in(node, sent), ""
    return None, next(cause for cause, count in state.refused.items() if count > before.get(cause, 0))


def _estimate_in(node: EstimatorNode, sent: tuple[Outgoing, ...]) -> ToldEstimate | None:
    told = (each.payload for each in sent if each.topic == node.topics.estimate)
    return next((_read(payload, node.rules.times_at) for payload in told), None)


def _read(payload: bytes, times_at: int) -> ToldEstimate:
    """Read an estimate whose times stand at a place; ten times as fast as the general codec does it all."""
    at = aligned(times_at + 2 * STAMP_BYTES, 8)
    numbers = _NUMBERS.unpack_from(payload, at)
    text_at = aligned(at + _NUMBERS.size, 4) + 4
    bounds_at = aligned(text_at + int.from_bytes(payload[text_at - 4 : text_at], "little"), 8)
    reason = payload[text_at:bounds_at].partition(b"\0")[0].decode()
    variances = numbers[_SEEN : _SEEN + _ELEMENTS : len(QUANTITIES) + 1]
    return ToldEstimate(
        numbers[-1], reason, numbers[:_SEEN], variances, _BOUNDS.unpack_from(payload, bounds_at)
    )


def told_by(message: LeaderEstimate) -> ToldEstimate:
    """The same of a message."""
    return ToldEstimate(
        message.status,
        message.reason,
        tuple(getattr(message, name) for name in ("rho", "alpha2", *QUANTITIES)),
        tuple(message.covariance[:: len(QUANTITIES) + 1].tolist()),
        (message.bound_v1, message.bound_alpha1, message.bound_h),
    )


class _Feed:
    """Messages of the rows of tracks."""

    def __init__(self, tracks: PoseTracks, scenario: Scenario) -> None:
        names, n = topics_of(scenario), len(tracks.t_ns)
        self._times = tracks.t_ns.tolist()
        self._frame = frame_template(MOCAP_FRAME, bodies_of(scenario))
        self._odometry = odometry_template(*odometry_frames(names.follower))
        self._odom = names.odom
        self.seen = _whole(tracks.leader, tracks.follower)
        self._poses: Rows[SeenPose] = rows_of(SeenPose, 2 * n)
        for k, ((x, y), own) in enumerate(zip(tracks.leader.tolist(), tracks.follower.tolist(), strict=True)):
            store(self._poses, 2 * k, seen_pose(Pose(x, y, 0.0)))
            store(self._poses, 2 * k + 1, seen_pose(Pose(*own)))
        self.moved = [False] * n if tracks.motion is None else _whole(tracks.motion)
        if tracks.motion is not None:
            self._motions: Rows[Odometry] = rows_of(Odometry, n)
            for k, (v, u) in enumerate(tracks.motion.tolist()):
                store(self._motions, k, Odometry(seen_pose(Pose(0.0, 0.0, 0.0)), Motion(v, u), 0))

    def frame(self, k: int) -> Event:
        """The mocap frame of a row."""
        buffer, places_at = self._frame
        tell_frame(buffer, places_at, self._times[k], k, self._poses, 2 * k)
        return Event(topics.RIGID_BODIES, buffer.tobytes())

    def odometry(self, k: int) -> Event:
        """The odometry of a row."""
        buffer, numbers_at = self._odometry
        tell_odometry(buffer, numbers_at, self._times[k], self._motions, k)
        return Event(self._odom, buffer.tobytes())


def _whole(*arrays: FloatArray) -> list[bool]:
    """Which rows have a number everywhere."""
    whole: NDArray[np.bool_] = np.all(np.isfinite(np.column_stack(arrays)), axis=1)
    return [bool(each) for each in whole]
