"""How the follower's odometry compares with its own mocap track: its delay, its lag and its scales."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.own_motion.input_alignment import UNKNOWN, Alignment, Known, align_odometry
from estimation.own_motion.odometry_correction import LEAST_LAG, LEAST_SCALE, SDS_LEFT, is_surely_off
from estimation.time.host_time import NO_TIME_YET, time_rows
from formation.angles import FloatArray
from formation.mount import robot_pose
from formation.records import plain_rows_of
from hil.log.reader import Log
from hil.nodes.frame_time import time_of, time_rules
from hil.nodes.refusals import NOT_REFUSED
from hil.replay.kept import Kept
from hil.scenario.leader_model import follower_mount
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.reading import RefusedError, read_frame, read_odometry
from hil.wire.topics import topics_of

Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class OwnRecord:
    """What a log holds of the follower's motion.

    ``poses``: x, y [m], theta [rad] by capture time on the host's clock [ns]. ``motions``: v2 [m/s],
    u2 [rad/s] of odometry by its stamp [ns].
    """

    poses: Mapping[int, tuple[float, float, float]]
    motions: Mapping[int, tuple[float, float]]


def own_record(log: Log, scenario: Scenario) -> OwnRecord:
    """Poses and odometry of a scenario's follower, without what an estimator would refuse."""
    names, mount = topics_of(scenario), follower_mount(scenario)
    poses: dict[int, tuple[float, float, float]] = {}
    motions: dict[int, tuple[float, float]] = {}
    times, rows, rules = NO_TIME_YET, time_rows(plain_rows_of), time_rules(scenario)
    for record in log.records([name for name in (topics.RIGID_BODIES, names.odom) if name in log.topics]):
        try:
            if record.topic == names.odom:
                sample = read_odometry(record.payload, record.log_ns)
                motions[sample.stamp_ns] = (sample.v2, sample.u2)
            else:
                frame = read_frame(record.payload, *bodies_of(scenario))
                timed = time_of(times, rows, rules, frame, record.log_ns)
                times = timed.times
                if timed.refusal == NOT_REFUSED:
                    robot = robot_pose(frame.follower, mount)
                    poses[timed.capture_ns] = (robot.x, robot.y, robot.theta)
        except RefusedError:
            continue
    return OwnRecord(poses, motions)


def own_alignment(record: OwnRecord) -> Alignment:
    """Delay and scales of the odometry against the poses."""
    seen_ns, odometry_ns = sorted(record.poses), sorted(record.motions)
    return _aligned(
        np.array(seen_ns, dtype=np.int64),
        np.array([record.poses[at_ns] for at_ns in seen_ns]),
        np.array(odometry_ns, dtype=np.int64),
        np.array([record.motions[at_ns] for at_ns in odometry_ns]),
    )


def odometry_response(found: Alignment) -> dict[str, Known | None]:
    """What the motion makes of odometry, by the estimator's keys for it; None for what is not told."""
    return {
        "input_delay_s": found.delay,
        "input_time_constant_s": found.lag,
        "input_scale_v": found.scale_v,
        "input_scale_u": found.scale_u,
    }


def response_settings(found: Alignment, scenario: Scenario) -> dict[str, float]:
    """Keys of the estimator that put odometry right, where they are surely not as the scenario has them.

    Of commands that stand in for odometry also their delay, and how much later than that motion may come: as
    delay and lag together are uncertain. Any other delay is one of stamps.
    """
    given, wanted = scenario.estimator, odometry_response(found)
    settings: dict[str, float] = {}
    if (
        given.input_lag_s > 0.0
        and found.delay is not None
        and found.late is not None
        and found.lag is not None
    ):
        settings["input_delay_s"] = max(0.0, found.delay.value)
        settings["input_lag_s"] = SDS_LEFT * found.late.sd
        settings["input_time_constant_s"] = found.lag.value
    for key, least in (
        ("input_time_constant_s", LEAST_LAG),
        ("input_scale_v", LEAST_SCALE),
        ("input_scale_u", LEAST_SCALE),
    ):
        known = wanted[key]
        if known is not None and is_surely_off(known, getattr(given, key), least):
            settings[key] = known.value
    return {f"estimator.{key}": value for key, value in settings.items()}


def _aligned(seen_ns: Stamps, poses: FloatArray, odometry_ns: Stamps, motions: FloatArray) -> Alignment:
    if not (len(seen_ns) and len(odometry_ns)):
        return UNKNOWN
    zero_ns = min(seen_ns[0], odometry_ns[0])
    return align_odometry((seen_ns - zero_ns) * 1e-9, poses, (odometry_ns - zero_ns) * 1e-9, motions)


def _last_of_each(at_ns: Stamps, *columns: FloatArray) -> tuple[Stamps, FloatArray]:
    """Every moment once, in order, with the last numbers that there are of it."""
    moments, backwards = np.unique(at_ns[::-1], return_index=True)
    return moments, np.column_stack([column[::-1][backwards] for column in columns])


def judge_kept_motion(kept: Kept) -> dict[str, float]:
    """The same as :func:`judge_own_motion`, of what a replay in one pass has kept."""
    poses, motions = kept.poses, kept.motions
    seen_ns, seen = _last_of_each(poses["capture_ns"], poses["x"], poses["y"], poses["theta"])
    odometry_ns, moved = _last_of_each(motions["stamp_ns"], motions["v2"], motions["u2"])
    return _figures(_aligned(seen_ns, seen, odometry_ns, moved))


def judge_own_motion(log: Log, scenario: Scenario) -> dict[str, float]:
    """The ``own_motion`` part of a summary: delay_s, time_constant_s, scale_v and scale_u, each with its sd.

    ``delay_s`` is by how much the robot's motion comes later than odometry says, ``time_constant_s`` that of
    a lag with which it answers; the true motion is the scale times what these make of odometry. What the log
    does not let know is absent: there may be no mocap, or hardly any motion.
    """
    if not {topics.RIGID_BODIES, topics_of(scenario).odom} <= set(log.topics):
        return {}
    return _figures(own_alignment(own_record(log, scenario)))


def _figures(found: Alignment) -> dict[str, float]:
    result: dict[str, float] = {}
    named = (
        ("delay_s", found.delay),
        ("time_constant_s", found.lag),
        ("scale_v", found.scale_v),
        ("scale_u", found.scale_u),
    )
    for name, known in named:
        if known is not None:
            result |= {name: known.value, f"{name}_sd": known.sd}
    return result
