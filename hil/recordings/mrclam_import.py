"""Turning two robots of a UTIAS multi-robot data set (MRCLAM) into a log of a leader and a follower."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from msgspec.structs import replace

from estimation.calibration.smoothed_track import poses_at, smoothed_motion
from formation.angles import FloatArray
from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.log.described_log import DescribedLog
from hil.log.metadata import IMPORT, certificate_metadata, log_metadata
from hil.recordings.imported import Imported
from hil.recordings.mrclam_folder import Pair, Series, read_pair
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import encode, header, typename_of
from hil.wire.topics import Topics, topics_of

SCENARIO, CAMERA_SCENARIO = "mrclam", "mrclam-camera"
_SETTLING_S = 5.0
_NOWHERE = Pose(0.0, 0.0, 0.0)

Sightings = Literal["vicon", "camera"]

Stamped = tuple[int, int, str, msg.Message]
"""Stamp [ns], rank among messages of that stamp, topic, message."""


def import_mrclam(
    folder: Path, leader: int, follower: int, out: Path, sightings: Sightings = "vicon"
) -> Imported:
    """Write what is known of two robots and the follower's odometry to the new log ``out``.

    ``sightings`` vicon: the tracks. Every pose of the follower makes a frame, the leader's pose interpolated
    to its time and left out where it was not seen; ``rows`` counts frames. ``sightings`` camera: the
    follower's own, range and bearing of the leader's bar code; ``rows`` counts these, and the tracks are
    nothing but truth. The scenario is the shipped ``mrclam`` or ``mrclam-camera``, judged from 5 s after the
    beginning on. The truth is the same tracks smoothed by :func:`smoothed_motion`. Raises
    :class:`UsageError` as :func:`read_pair`, before anything is written, and if ``out`` exists or cannot be
    created. No half log is left behind.
    """
    pair = read_pair(folder, leader, follower, sighted=sightings == "camera")
    rows_ns = pair.follower_track.stamps_ns if pair.sightings is None else pair.sightings.stamps_ns
    scenario = _scenario(pair)
    metadata = log_metadata(scenario, IMPORT) | certificate_metadata(
        certificate_json(certificate_of(scenario, driven=False))
    )
    metadata["source"] = {"folder": folder.name, "leader": pair.leader, "follower": pair.follower}
    names = topics_of(scenario)
    measured = _frames(pair) if pair.sightings is None else _seen(pair.sightings, names)
    streams = (_odometry(pair, names.odom), measured, _truth(pair))
    with DescribedLog(out, metadata) as log:
        try:
            for stamp_ns, _, topic, message in heapq.merge(*streams, key=lambda each: each[:2]):
                log.write(topic, typename_of(message), encode(message), stamp_ns, stamp_ns)
        except BaseException:
            out.unlink(missing_ok=True)
            raise
    return Imported(len(rows_ns), log.messages, int(rows_ns[0]) * 1e-9, int(rows_ns[-1]) * 1e-9)


def _scenario(pair: Pair) -> Scenario:
    given = load_scenario(SCENARIO if pair.sightings is None else CAMERA_SCENARIO)
    from_s = int(pair.follower_track.stamps_ns[0]) * 1e-9 + _SETTLING_S
    return replace(
        given,
        leader=replace(given.leader, name=pair.leader),
        follower=replace(given.follower, name=pair.follower),
        run=replace(given.run, evaluate_from_s=from_s),
    )


def _odometry(pair: Pair, topic: str) -> Iterator[Stamped]:
    for stamp_ns, (v, u) in zip(pair.odometry.stamps_ns.tolist(), pair.odometry.values.tolist(), strict=True):
        yield stamp_ns, 0, topic, odometry_message(stamp_ns, pair.follower, _NOWHERE, Motion(v, u))


def _frames(pair: Pair) -> Iterator[Stamped]:
    track = pair.follower_track
    leader = poses_at(pair.leader_track.stamps_ns, pair.leader_track.values, track.stamps_ns)
    for number, stamp_ns in enumerate(track.stamps_ns.tolist()):
        bodies = [(pair.follower, Pose(*track.values[number].tolist()))]
        if np.isfinite(leader[number, 0]):
            bodies.insert(0, (pair.leader, Pose(*leader[number].tolist())))
        yield stamp_ns, 1, topics.RIGID_BODIES, frame_message(stamp_ns, number, bodies)


def _seen(sightings: Series, names: Topics) -> Iterator[Stamped]:
    for stamp_ns, (rho, alpha2) in zip(sightings.stamps_ns.tolist(), sightings.values.tolist(), strict=True):
        yield stamp_ns, 1, names.sighting, msg.RangeBearing(header(stamp_ns, names.follower), rho, alpha2)


def _truth(pair: Pair) -> Iterator[Stamped]:
    moments_ns = pair.follower_track.stamps_ns
    if pair.sightings is not None:
        moments_ns = np.union1d(moments_ns, pair.sightings.stamps_ns)
    leader, follower = (
        smoothed_motion(track.stamps_ns, track.values, moments_ns)
        for track in (pair.leader_track, pair.follower_track)
    )
    rows: FloatArray = np.column_stack([leader.poses, leader.motion, follower.poses, follower.motion])
    for number, (stamp_ns, row) in enumerate(zip(moments_ns.tolist(), rows.tolist(), strict=True)):
        yield stamp_ns, 2, topics.TRUTH, msg.Truth(header(stamp_ns, "world"), number, *row)
