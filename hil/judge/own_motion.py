"""How the follower's odometry compares with its own mocap track: its delay and its scales."""

from __future__ import annotations

import numpy as np

from estimation.host_time import HostTime
from estimation.input_alignment import align_odometry
from hil.log.reader import Log
from hil.nodes.frame_time import FrameTime
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.intake import RefusedError, read_frame, read_odometry
from hil.wire.topics import topics_of


def judge_own_motion(log: Log, scenario: Scenario) -> dict[str, float]:
    """The ``own_motion`` part of a summary: delay_s, scale_v and scale_u, each with its standard deviation.

    ``delay_s`` is by how much the robot's motion comes later than odometry says; the true motion is the scale
    times odometry. What the log does not let know is absent: there may be no mocap, or hardly any motion.
    """
    names = topics_of(scenario)
    poses: dict[int, tuple[float, float, float]] = {}
    motions: dict[int, tuple[float, float]] = {}
    times, frame_time = HostTime(), FrameTime(scenario)
    if not {topics.RIGID_BODIES, names.odom} <= set(log.topics):
        return {}
    for record in log.records([topics.RIGID_BODIES, names.odom]):
        try:
            if record.topic == names.odom:
                sample = read_odometry(record.payload, record.log_ns)
                motions[sample.stamp_ns] = (sample.v2, sample.u2)
            else:
                frame = read_frame(record.payload, names.leader, names.follower)
                timed = frame_time.of(times, frame, record.log_ns)
                times = timed.times
                if not timed.refusal:
                    poses[timed.capture_ns] = (frame.follower.x, frame.follower.y, frame.follower.theta)
        except RefusedError:
            continue
    zero_ns = min((*poses, *motions), default=0)
    seen_ns, told_ns = sorted(poses), sorted(motions)
    found = align_odometry(
        np.array([(at_ns - zero_ns) * 1e-9 for at_ns in seen_ns]),
        np.array([poses[at_ns] for at_ns in seen_ns]).reshape(-1, 3),
        np.array([(at_ns - zero_ns) * 1e-9 for at_ns in told_ns]),
        np.array([motions[at_ns] for at_ns in told_ns]).reshape(-1, 2),
    )
    result: dict[str, float] = {}
    for name, known in (("delay_s", found.delay), ("scale_v", found.scale_v), ("scale_u", found.scale_u)):
        if known is not None:
            result |= {name: known.value, f"{name}_sd": known.sd}
    return result
