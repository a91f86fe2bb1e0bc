"""Keys of a scenario that are younger than logs may be: what they were before they were there.

A log holds every key that there was when it was written. One that it lacks came later, and must mean to its
replay what abreast did without it, whatever is today's default.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

BEFORE: dict[str, Any] = {
    "source.type": "RigidBodies",
    "source.topic": "",
    "source.stamp": "header",
    "source.up": "z",
    "source.scale": 1.0,
    "source.pair_within_s": 0.002,
    "source.emulated": "",
    "recorder.rotate_mb": 0.0,
    "recorder.rotate_s": 0.0,
    "guard.present": False,
    "guard.age_s": 0.15,
    "guard.latch_s": 1.0,
    "guard.separation": 0.0,
    "robot.v_rate": 0.0,
    "robot.u_rate": 0.0,
    "wire.layout": "ros2dds",
    "wire.prefix": "",
    "wire.domain": 0,
    "wire.distro": "jazzy",
    "estimator.slip_v2": 0.0,
    "estimator.slip_u2": 0.0,
    "estimator.settled_heading": 0.0,
    "estimator.noise": "given",
    "controller.mount_check": "warn",
    "leader.mount": [0.0, 0.0, 0.0],
    "follower.mount": [0.0, 0.0, 0.0],
    "mocap.leader_mount": [0.0, 0.0, 0.0],
    "mocap.follower_mount": [0.0, 0.0, 0.0],
    "robot.odometry_faults": [],
    "estimator.own_motion": "odometry",
    "estimator.process_noise": "given",
    "estimator.input_time_constant_s": 0.0,
    "estimator.input_scale_v": 1.0,
    "estimator.input_scale_u": 1.0,
}
"""Value of ``section.key`` for logs without it; a test asks for every key that a reference log lacks."""


def with_older_keys(tree: Mapping[str, Any], before: Mapping[str, Any] = BEFORE) -> dict[str, Any]:
    """The scenario of a log, with the keys that came later as they were before; others stay as they are.

    >>> with_older_keys({"run": {"seed": 2}}, {"run.seed": 1, "run.pace": 1.0})
    {'run': {'seed': 2, 'pace': 1.0}}
    """
    whole = deepcopy(dict(tree))
    for name, value in before.items():
        section, _, key = name.partition(".")
        whole.setdefault(section, {}).setdefault(key, value)
    return whole
