"""What the emulated lab sends, against the general codec and against what its plant holds."""

from __future__ import annotations

import numpy as np
import pytest

from formation.angles import wrap
from formation.pose import Pose
from formation.records import load
from hil.emulator.lab_messages import odometry_frames
from hil.emulator.lab_writer import LabWriter
from hil.emulator.mocap import SeenPose
from hil.emulator.plant import Plant
from hil.emulator.world import CAPTURE, FRAME, NOTHING, SAMPLE, Odometry
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.scenario.start import chain_poses
from hil.wire import message_types as msg
from hil.wire.messages import encode, header
from hil.wire.topics import link_topics

BEGIN_NS = 1_000_000_000


def pose_of(seen: SeenPose) -> msg.Pose:
    at = msg.Point(x=seen.x, y=seen.y, z=0.0)
    return msg.Pose(position=at, orientation=msg.Quaternion(x=0.0, y=0.0, z=seen.qz, w=seen.qw))


def odometry_of(name: str, stamp_ns: int, told: Odometry) -> msg.Odometry:
    frame_id, child, none = *odometry_frames(name), np.zeros(36)
    twist = msg.Twist(
        linear=msg.Vector3(x=told.motion.v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=told.motion.u)
    )
    return msg.Odometry(
        header=header(stamp_ns, frame_id),
        child_frame_id=child,
        pose=msg.PoseWithCovariance(pose=pose_of(told.pose), covariance=none),
        twist=msg.TwistWithCovariance(twist=twist, covariance=none),
    )


@pytest.mark.parametrize("name", ["turtlebot3", "chain5-turtlebot3"])
def test_frames_odometry_and_truth_are_what_the_general_codec_would_write(name: str) -> None:
    scenario = load_scenario(name)
    pairs = [link_topics(link) for link in links_of(scenario)]
    names = (pairs[0].leader, *(pair.follower for pair in pairs))
    plant = Plant(scenario, chain_poses(scenario, len(names)), BEGIN_NS)
    plant.let_go()
    writer, met = LabWriter(names, pairs), set()
    while (happened := plant.advance(BEGIN_NS + 400_000_000)).kind != NOTHING:
        met.add(happened.kind)
        first, memory, at_ns = happened.slot * len(names), plant.memory, happened.at_ns
        if happened.kind == FRAME:
            seen = [load(SeenPose, memory.seen, first + k) for k in range(len(names))]
            bodies = [msg.RigidBody(each, [], pose_of(at)) for each, at in zip(names, seen, strict=True)]
            expected = msg.RigidBodies(header(happened.stamp_ns, "mocap"), happened.number, bodies)
            sent = writer.frame(plant, happened.slot, happened.stamp_ns, happened.number, at_ns)
            assert sent.payload == encode(expected)
        elif happened.kind == SAMPLE:
            told = [load(Odometry, memory.odometry, first + k) for k in range(len(names))]
            stamp_ns = happened.stamp_ns
            wanted = [
                encode(odometry_of(*pair)) for pair in zip(names, [stamp_ns] * len(names), told, strict=True)
            ]
            assert [each.payload for each in writer.odometry(plant, happened.slot, stamp_ns)] == wanted
        elif happened.kind == CAPTURE:
            states: list[float] = []
            for robot in plant.robots():
                pose = Pose(robot.at.x, robot.at.y, float(wrap(robot.heading)))
                states += [*pose, *robot.motion]
            for k, each in enumerate(writer.truths(plant, at_ns, happened.number)):
                truth = msg.Truth(header(at_ns, "mocap"), happened.number, *states[5 * k : 5 * k + 10])
                assert (each.topic, each.payload) == (pairs[k].truth, encode(truth))
    assert met == {CAPTURE, FRAME, SAMPLE}
