from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from estimation.tracking.tracker import Status
from formation import pose as plane
from formation.angles import wrap
from formation.shape import Shape, follower_pose, shape_of, shape_rates
from hil.judge.frames import Frames
from hil.judge.run_data import LogFacts, RunData
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.scenario.files import load_scenario
from hil.wire.message_types import (
    CertifiedEstimate,
    Command,
    Consumed,
    DiagnosticArray,
    DiagnosticStatus,
    KeyValue,
    LeaderEstimate,
    Malformed,
    Marker,
    Message,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    RangeBearing,
    RigidBodies,
    RigidBody,
    Truth,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    Vector3,
)
from hil.wire.messages import header, to_time

STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture(scope="session")
def sample_messages() -> dict[str, Message]:
    """One message of every type that is logged, by topic, with texts and lists that shift the alignment."""
    stamp = header(STAMP_NS, "world")
    pose = Pose(position=Point(x=0.1, y=-0.2, z=0.3), orientation=Quaternion(x=0.0, y=0.0, z=0.6, w=0.8))
    twist = Twist(linear=Vector3(x=0.1, y=0.0, z=0.0), angular=Vector3(x=0.0, y=0.0, z=-0.7))
    marker = Marker(id_type=-1, marker_index=3, marker_name="m", translation=Point(x=1.0, y=2.0, z=3.0))
    consumed = [Consumed(2**64 - 1, to_time(STAMP_NS)), Consumed(0, to_time(0))]
    level = DiagnosticStatus(
        level=1, name="mocap", message="late", hardware_id="", values=[KeyValue(key="frames", value="12")]
    )
    estimate = LeaderEstimate(
        header=stamp,
        measured=to_time(STAMP_NS),
        computed=to_time(STAMP_NS + 1),
        rho=0.2,
        alpha2=1.5,
        rho_dot=-0.01,
        alpha2_dot=0.02,
        v1=0.08,
        alpha1=-1.6,
        u1=0.7,
        v2=0.09,
        u2=-0.5,
        covariance=np.arange(25.0),
        nis=float("nan"),
        status=1,
        reason="ärger",
        bound_v1=0.1,
        bound_alpha1=0.2,
        bound_h=float("inf"),
        consumed=consumed,
    )
    return {
        "rigid_bodies": RigidBodies(
            stamp, 7, [RigidBody("leader", [marker, marker], pose), RigidBody("follower", [], pose)]
        ),
        "leader/odom": Odometry(
            header=stamp,
            child_frame_id="base_link",
            pose=PoseWithCovariance(pose=pose, covariance=np.zeros(36)),
            twist=TwistWithCovariance(twist=twist, covariance=np.ones(36)),
        ),
        "follower/cmd_vel": TwistStamped(header=stamp, twist=twist),
        "leader/cmd_vel": twist,
        "follower/leader_estimate": estimate,
        "follower/certified": CertifiedEstimate(
            stamp, to_time(STAMP_NS + 1), 0.08, float("nan"), -1.6, 0.25, 53, "größer"
        ),
        "follower/command": Command(
            stamp, to_time(1), to_time(2), 0.1, 0.2, float("nan"), 0.4, True, "stale", False, consumed
        ),
        "truth": Truth(stamp, 9, *(float(value) for value in range(10))),
        "follower/range_bearing": RangeBearing(stamp, 0.25, -1.0),
        "malformed": Malformed(stamp, "rigid_bodies", np.array([1, 2, 255], dtype=np.uint8)),
        "diagnostics": DiagnosticArray(header=stamp, status=[level]),
    }


def _plain(value: object) -> object:
    if dataclasses.is_dataclass(value):
        # The classes of rosbags count their type name and their constants as fields.
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _plain(getattr(value, name)) for name in names if name[0] != "_" and not name.isupper()}
    if hasattr(value, "__slots__") and type(value).__module__.startswith("mcap_ros2"):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple, bytes, np.ndarray)):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


@pytest.fixture(scope="session")
def plain() -> Callable[[object], object]:
    """Turn a message of any library into dictionaries, lists and numbers."""
    return _plain


@pytest.fixture(scope="session")
def short_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """A lockstep run of 6 s with 5 % of the frames lost, judged from 3 s on."""
    path = tmp_path_factory.mktemp("short") / "run.mcap"
    given = ("run.seed=7", "run.duration_s=6.0", "run.evaluate_from_s=3.0", "mocap.loss=0.05")
    run_lockstep(load_scenario("turtlebot3", given), path)
    return read_log(path)


@pytest.fixture(scope="session")
def exact_run_data() -> RunData:
    """A made-up run of 4 s, judged from 1 s on: a leader on a circle, a follower abreast, no error at all."""
    scenario = load_scenario("turtlebot3", ["run.duration_s=4.0", "run.evaluate_from_s=1.0"])
    shape, leads, follows = (
        Shape(0.2, -0.5 * math.pi, 0.5 * math.pi),
        plane.Motion(0.08, 0.3),
        plane.Motion(0.14, 0.3),
    )
    leader, truth = plane.Pose(0.3, 0.0, 3.0), []
    for number in range(241):
        follower = follower_pose(shape, leader)
        truth.append(
            Truth(
                header(STAMP_NS + number * FRAME_NS, "mocap"),
                number,
                *(leader.x, leader.y, leader.theta, leads.v, leads.u),
                *(follower.x, follower.y, follower.theta, follows.v, follows.u),
            )
        )
        leader = plane.advance(leader, leads.v, leads.u, FRAME_NS * 1e-9)
    return RunData(
        scenario=scenario,
        mode="lockstep",
        estimates=[_exact_estimate(each) for each in truth],
        commands=[_exact_command(each) for each in truth],
        truth=truth,
        taken={"frames": 241, "used": 240, "odometry": 120},
        refused={"gated": 1},
        zero_ns=STAMP_NS,
        motion_since_ns=STAMP_NS,
        frames=Frames(241, [STAMP_NS + number * FRAME_NS for number in range(241)]),
        log=LogFacts("run.mcap", 1000, 123_456),
    )


FRAME_NS = 16_666_667


def _exact_estimate(truth: Truth) -> LeaderEstimate:
    shape = shape_of(
        plane.Pose(truth.leader_x, truth.leader_y, truth.leader_theta),
        plane.Pose(truth.follower_x, truth.follower_y, truth.follower_theta),
    )
    rates = shape_rates(shape, plane.Motion(truth.v1, truth.u1), plane.Motion(truth.v2, truth.u2))
    return LeaderEstimate(
        header=truth.header,
        measured=truth.header.stamp,
        computed=truth.header.stamp,
        rho=shape.rho,
        alpha2=shape.alpha2,
        rho_dot=rates.rho_dot,
        alpha2_dot=rates.alpha2_dot,
        v1=truth.v1,
        alpha1=float(wrap(shape.alpha1)),
        u1=truth.u1,
        v2=truth.v2,
        u2=truth.u2,
        covariance=np.diag([1e-6, 1e-4, 1e-6, 1e-4, 1e-2]).reshape(25),
        nis=2.0,
        status=int(Status.TRACKING),
        reason="",
        bound_v1=0.05,
        bound_alpha1=0.5,
        bound_h=1.0,
        consumed=[],
    )


def _exact_command(truth: Truth) -> Command:
    """Issued 30 ms after the capture that it rests on."""
    stamp = truth.header.stamp
    issued = header(stamp.sec * 10**9 + stamp.nanosec + 30_000_000, "follower")
    return Command(issued, stamp, stamp, truth.v2, truth.u2, truth.v2, truth.u2, False, "", True, [])
