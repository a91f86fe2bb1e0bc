"""Where bodies sit on their robots, from the poses in a log: both of a pair, in full.

The leader's orientation is looked at here, and nowhere where an estimate or a command is made.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimation.calibration.mounts import (
    NOTHING_FOUND,
    FoundMount,
    WheelSpeed,
    find_mount,
    short_drive_mount,
)
from estimation.models.measurement import PoseNoise
from estimation.time.host_time import NO_TIME_YET, time_rows
from formation.angles import FloatArray
from formation.mount import Mount
from formation.pose import Pose
from formation.records import load, plain_rows_of
from hil.log.events import Timed, logged_events
from hil.log.metadata import IMPORT, mode_of
from hil.log.reader import Log
from hil.nodes.frame_time import time_of, time_rules
from hil.nodes.refusals import NOT_REFUSED
from hil.scenario.leader_model import follower_mount, leader_mount, pose_noise
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.message_checks import planar
from hil.wire.reading import RefusedError, frame_reader, read_odometry
from hil.wire.records import Body
from hil.wire.topics import topics_of

_NS = 1e-9
_DIGITS = 5  # of a proposed mount: hundredths of a millimetre, thousandths of a degree


@dataclass(frozen=True, slots=True)
class Mounts:
    """Mounts that a log shows, and those to go on with: what is not known stays as the scenario had it.

    ``bare``: robots whose bodies have no orientation, by which alone a mount could be found.
    """

    leader: FoundMount
    follower: FoundMount
    settings: dict[str, Mount]
    bare: frozenset[str] = frozenset()

    @property
    def known(self) -> bool:
        """Whether anything of them is."""
        return bool(self.settings)

    @property
    def overrides(self) -> dict[str, list[float]]:
        """The settings as a scenario takes them."""
        return {key: list(mount) for key, mount in self.settings.items()}

    def as_dict(self) -> dict[str, Any]:
        """The ``mounts`` of a calibration."""
        return {
            robot: {"x": found.x, "y": found.y, "yaw": found.yaw, "sd": list(found.sd)}
            for robot, found in (("leader", self.leader), ("follower", self.follower))
        }


@dataclass(frozen=True, slots=True, eq=False)
class BodyTracks:
    """Poses of both bodies by capture time [ns], and speeds [m/s] of both robots by the stamp of odometry."""

    leader: dict[int, Pose]
    follower: dict[int, Pose]
    leader_speed: dict[int, float]
    follower_speed: dict[int, float]


def mounts_of_log(
    log: Log, scenario: Scenario, from_s: float | None = None, to_s: float | None = None
) -> Mounts:
    """Mounts of a pair by a log of ours, or by its span from ``from_s`` to ``to_s``.

    Times [s] are the source's own in an imported log, else they count from the first odometry.
    """
    names = topics_of(scenario)
    wanted = [name for name in (topics.RIGID_BODIES, names.odom, names.leader_odom) if name in log.topics]
    return mounts_of_events(
        logged_events(log, wanted), scenario, from_s, to_s, absolute=mode_of(log) == IMPORT
    )


def mounts_of_events(
    events: Iterable[Timed],
    scenario: Scenario,
    from_s: float | None = None,
    to_s: float | None = None,
    *,
    absolute: bool = False,
) -> Mounts:
    """The same by messages of ours; times count from the first odometry unless they are ``absolute``."""
    tracks = body_tracks(events, scenario)
    if scenario.estimator.input_lag_s > 0.0:
        # Commands stand in for odometry: they say what was wanted of the wheels, not what these did.
        tracks = replace(tracks, follower_speed={})
    motions = tracks.follower_speed or tracks.leader_speed
    zero_ns = 0 if absolute else min(motions or tracks.follower, default=0)
    begin_ns = -1 if from_s is None else zero_ns + round(from_s * 1e9)
    end_ns = 2**63 if to_s is None else zero_ns + round(to_s * 1e9)
    noise = pose_noise(scenario)
    shown = {
        robot: {at_ns: pose for at_ns, pose in poses.items() if begin_ns <= at_ns <= end_ns}
        for robot, poses in (("leader", tracks.leader), ("follower", tracks.follower))
    }
    bare = frozenset(robot for robot, poses in shown.items() if _is_bare(poses))
    leader, follower = (
        NOTHING_FOUND if robot in bare else _found(shown[robot], speeds, noise)
        for robot, speeds in (("leader", tracks.leader_speed), ("follower", tracks.follower_speed))
    )
    given = {"leader": (leader, leader_mount(scenario)), "follower": (follower, follower_mount(scenario))}
    settings = {
        f"{robot}.mount": Mount(*(round(value, _DIGITS) for value in found.mount(before)))
        for robot, (found, before) in given.items()
        if found != NOTHING_FOUND
    }
    return Mounts(leader, follower, settings, bare)


def body_tracks(events: Iterable[Timed], scenario: Scenario) -> BodyTracks:
    """What messages of ours tell of both bodies."""
    names, tracks = topics_of(scenario), BodyTracks({}, {}, {}, {})
    leader, follower = bodies_of(scenario)
    reader = frame_reader(frozenset({leader, follower}))
    wanted, leader_at = reader.pair(leader, follower), reader.names.index(leader)
    times, rows, rules = NO_TIME_YET, time_rows(plain_rows_of), time_rules(scenario)
    speeds = {names.odom: tracks.follower_speed, names.leader_odom: tracks.leader_speed}
    for event, now_ns in events:
        if event.topic in speeds:
            try:
                sample = read_odometry(event.payload, now_ns)
            except RefusedError:
                continue
            speeds[event.topic][sample.stamp_ns] = sample.v2
        elif event.topic == topics.RIGID_BODIES:
            frame = reader.read(event.payload, wanted)
            if frame.cause != NOT_REFUSED:
                continue
            timed = time_of(times, rows, rules, frame, now_ns)
            times = timed.times
            if timed.refusal == NOT_REFUSED:
                at_ns = timed.capture_ns
                tracks.leader[at_ns] = planar(load(Body, reader.bodies, leader_at).place)
                tracks.follower[at_ns] = Pose(frame.follower_x, frame.follower_y, frame.follower_theta)
    return tracks


def _is_bare(poses: dict[int, Pose]) -> bool:
    """Whether a body never turns by a hair: its source knows no orientation."""
    return len(poses) > 1 and np.ptp([pose.theta for pose in poses.values()]) == 0.0


def _found(poses: dict[int, Pose], speeds: dict[int, float], noise: PoseNoise) -> FoundMount:
    """Mount by poses and what wheels tell of the speed."""
    if len(poses) < 2:
        return NOTHING_FOUND
    stamps = sorted(poses)
    track = np.array([poses[at_ns] for at_ns in stamps])
    zero_ns = stamps[0]
    told = sorted(speeds)
    wheels = WheelSpeed(_seconds(told, zero_ns), np.array([speeds[at_ns] for at_ns in told]))
    finite = np.isfinite(wheels.v)
    wheels = WheelSpeed(wheels.t[finite], wheels.v[finite])
    found = find_mount(_seconds(stamps, zero_ns), track, wheels if len(wheels.t) else None)
    if found != NOTHING_FOUND:
        return found
    return short_drive_mount(stamps, [poses[at_ns] for at_ns in stamps], noise)


def _seconds(stamps_ns: list[int], zero_ns: int) -> FloatArray:
    return np.array([(at_ns - zero_ns) * _NS for at_ns in stamps_ns])


def said(robot: str, mounts: Mounts) -> str:
    """One line on what was found of a robot's mount, for people."""
    if robot in mounts.bare:
        return (
            f"body on the {robot}: has no orientation, by which its mount could be found; where it is not "
            f"above the middle of the axle, measure by how much and set {robot}.mount"
        )
    found, parts = mounts.leader if robot == "leader" else mounts.follower, []
    for name, value, sd, unit, scale in (
        ("yaw", found.yaw, found.sd[2], "deg", 180.0 / math.pi),
        ("x", found.x, found.sd[0], "mm", 1e3),
        ("y", found.y, found.sd[1], "mm", 1e3),
    ):
        if value is None or sd is None:
            parts.append(f"{name} not told by this motion")
        else:
            parts.append(f"{name} {value * scale:+.2f} {unit} give or take {sd * scale:.2f}")
    return f"body on the {robot}: {', '.join(parts)}"
