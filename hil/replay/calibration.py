"""Calibration of a range and bearing sensor, from a log with mocap poses of both robots beside sightings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.calibration.sensor_bias import SensorBias, TooFewSightingsError, find_sensor_bias
from estimation.calibration.smoothed_track import poses_at
from formation.angles import FloatArray
from formation.mount import Mount, robot_pose
from hil.errors import UsageError
from hil.log.events import logged_events
from hil.log.metadata import IMPORT, mode_of
from hil.log.reader import Log
from hil.scenario.leader_model import follower_mount
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.message_types import Truth
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns
from hil.wire.reading import RefusedError, read_frame, read_sighting
from hil.wire.records import Sighting
from hil.wire.topics import topics_of

Poses = dict[int, tuple[float, float, float, float, float]]
"""Leader's x, y [m] and follower's x, y [m], theta [rad] by capture time [ns]."""


def calibrate(
    log: Log, scenario: Scenario, from_s: float | None = None, to_s: float | None = None
) -> SensorBias:
    """Offsets of the sightings of a log, or of its span from ``from_s`` to ``to_s``.

    They are those of a sensor that sits where the scenario says; a wrong place shows as a bearing that is off
    by more the nearer the leader is.
    Times [s] are the source's own in an imported log, else they count from its first sighting. Poses are
    those of mocap frames, in a log without these those of its truth; they are taken linear between
    neighbours. Raises :class:`UsageError` for a log without sightings or without poses, and for a span that
    tells too little.
    """
    names = topics_of(scenario)
    if names.sighting not in log.topics:
        raise UsageError(
            f"log {log.path}: has no sightings to calibrate, expected topic {names.sighting!r}; "
            f"topics there: {', '.join(sorted(log.topics)) or 'none'}"
        )
    source = topics.RIGID_BODIES if topics.RIGID_BODIES in log.topics else topics.TRUTH
    sightings: dict[int, Sighting] = {}
    poses: Poses = {}
    late_ns = round(scenario.estimator.stamp_offset_s * 1e9)
    mount, bodies = follower_mount(scenario), bodies_of(scenario)
    for event, now_ns in logged_events(log, [source, names.sighting]):
        try:
            if event.topic == names.sighting:
                sighting = read_sighting(event.payload, now_ns)
                sightings[sighting.capture_ns] = sighting
            else:
                poses |= _poses(event, now_ns, bodies, late_ns, mount)
        except (RefusedError, MalformedPayloadError):
            continue
    if len(poses) < 2:
        raise UsageError(
            f"log {log.path}: has no poses of {bodies[0]!r} and {bodies[1]!r} beside its sightings; "
            f"expected mocap frames on {topics.RIGID_BODIES!r}, or poses in the [truth] of the import's map"
        )
    zero_ns = 0 if mode_of(log) == IMPORT else min(sightings, default=0)
    chosen = [
        sighting
        for capture_ns, sighting in sorted(sightings.items())
        if (from_s is None or capture_ns >= zero_ns + round(from_s * 1e9))
        and (to_s is None or capture_ns <= zero_ns + round(to_s * 1e9))
    ]
    eye = scenario.estimator
    true = _true(poses, [each.capture_ns for each in chosen], (eye.sensor_x, eye.sensor_y))
    seen = np.array([(each.rho, each.alpha2) for each in chosen]).reshape(-1, 2)
    try:
        return find_sensor_bias(seen, true)
    except TooFewSightingsError as error:
        raise UsageError(f"log {log.path}: {error}; give a longer span") from None


def _poses(event: Event, now_ns: int, bodies: tuple[str, str], late_ns: int, mount: Mount) -> Poses:
    if event.topic == topics.RIGID_BODIES:
        frame = read_frame(event.payload, *bodies, now_ns)
        own = robot_pose(frame.follower, mount)
        return {frame.capture_ns - late_ns: (*frame.leader, own.x, own.y, own.theta)}
    truth = decode_as(event.payload, Truth)
    positions = (truth.leader_x, truth.leader_y, truth.follower_x, truth.follower_y, truth.follower_theta)
    return {to_ns(truth.header.stamp): positions} if all(map(math.isfinite, positions)) else {}


def _true(poses: Poses, moments_ns: list[int], place: tuple[float, float]) -> FloatArray:
    """True ranges and bearings (n, 2) from a place on the follower, NaN where poses are unknown."""
    stamps_ns = np.array(sorted(poses), dtype=np.int64)
    known = np.array([poses[stamp] for stamp in stamps_ns.tolist()])
    wanted: NDArray[np.int64] = np.array(moments_ns, dtype=np.int64)
    follower = poses_at(stamps_ns, known[:, 2:5], wanted)
    leader = poses_at(stamps_ns, np.column_stack([known[:, 0:2], np.zeros(len(known))]), wanted)
    away = leader[:, 0:2] - follower[:, 0:2]
    cos, sin = np.cos(follower[:, 2]), np.sin(follower[:, 2])
    ahead = cos * away[:, 0] + sin * away[:, 1] - place[0]
    left = cos * away[:, 1] - sin * away[:, 0] - place[1]
    return np.column_stack([np.hypot(ahead, left), np.arctan2(left, ahead)])
