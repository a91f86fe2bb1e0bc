from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PointStamped as PointStamped
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PoseStamped as PoseStamped

from formation.pose import Motion, Pose
from formation.shape import shape_of
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.errors import UsageError
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.rerun import Replay, replay_foreign
from hil.replay.topic_map import load_topic_map
from hil.wire import message_types as msg
from hil.wire.messages import definition, encode, header, rihs01, to_ns, typename_of

START_NS = 1_700_000_000_000_000_000
V1, V2, U = 0.08, 0.1, 0.1

POSES = """
[topics]
leader_pose = "/vrpn/tb1/pose"
follower_pose = "/vrpn/tb2/pose"
odometry = "/tb2/odom"
"""
FRAMES = """
[topics]
rigid_bodies = "/mocap/rigid_bodies"
odometry = "/tb2/twist"
[bodies]
leader = "tb-1"
follower = "tb-2"
"""


@dataclass(frozen=True)
class Sent:
    """A message of a made-up lab: on which topic, speaking of when, arriving when."""

    topic: str
    message: msg.Message
    log_ns: int


def leader_at(t: float) -> Pose:
    """The leader drives a circle of radius v1 / U to the left."""
    return Pose(V1 / U * math.sin(U * t), V1 / U * (1.0 - math.cos(U * t)), U * t)


def follower_at(t: float) -> Pose:
    """The follower drives the circle around it, on its right."""
    return Pose(V2 / U * math.sin(U * t), V1 / U - V2 / U * math.cos(U * t), U * t)


def pose_message(pose: Pose) -> msg.Pose:
    half = 0.5 * pose.theta
    return msg.Pose(
        position=msg.Point(x=pose.x, y=pose.y, z=0.1),
        orientation=msg.Quaternion(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)),
    )


def lab(gap_ns: int = 0, stamps_ns: int = 0, frames: bool = False, as_odometry: bool = False) -> list[Sent]:
    """4 s at 50 Hz. The follower's pose is ``gap_ns`` younger; stamps run ``stamps_ns`` ahead of the log."""
    sent: list[Sent] = []
    for number in range(200):
        at_ns = START_NS + number * 20_000_000
        stamp_ns, late_ns = at_ns + stamps_ns, at_ns + 8_000_000
        t, later = number * 0.02, number * 0.02 + gap_ns * 1e-9
        motion = Motion(V2, U)
        if frames:
            bodies = (("tb-1", leader_at(t)), ("tb-2", follower_at(t)), ("wand", Pose(9.0, 9.0, 0.0)))
            sent.append(Sent("/mocap/rigid_bodies", frame_message(stamp_ns, number, bodies), late_ns))
            odometry = odometry_message(stamp_ns, "tb2", follower_at(t), motion)
            twist = msg.TwistStamped(header=odometry.header, twist=odometry.twist.twist)
            sent.append(Sent("/tb2/twist", twist, at_ns))
            continue
        for body, pose, ns in (
            ("tb1", leader_at(t), stamp_ns),
            ("tb2", follower_at(later), stamp_ns + gap_ns),
        ):
            if as_odometry:
                told = odometry_message(ns, body, pose, Motion(0.0, 0.0))
                message: msg.Message = replace(told, header=header(ns, "map"))
            else:
                message = PoseStamped(header=header(ns, "world"), pose=pose_message(pose))
            sent.append(Sent(f"/vrpn/{body}/pose", message, late_ns + gap_ns))
        sent.append(Sent("/tb2/odom", odometry_message(stamp_ns, "tb2", Pose(5.0, 5.0, 1.0), motion), at_ns))
    return sent


def bag(folder: Path, sent: list[Sent]) -> Log:
    """A rosbag2 recording with MCAP storage, written by another library's writer."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for each in sorted(sent, key=lambda each: each.log_ns):
            if each.topic not in connections:
                if isinstance(each.message, msg.RigidBodies | msg.RangeBearing):
                    connections[each.topic] = writer.add_connection(
                        each.topic,
                        each.message.__msgtype__,
                        msgdef=definition(each.message.__msgtype__),
                        rihs01=rihs01(each.message.__msgtype__),
                    )
                else:
                    connections[each.topic] = writer.add_connection(
                        each.topic, typename_of(each.message), typestore=store
                    )
            writer.write(connections[each.topic], each.log_ns, encode(each.message))
    return read_log(next((folder / "bag").glob("*.mcap")))


def chart(folder: Path, text: str) -> Path:
    (folder / "lab.toml").write_text(text)
    return folder / "lab.toml"


def last_is_right(played: Replay, angle: float = 1e-3) -> None:
    """After 4 s of exact poses the estimate is the truth, the bearing to within ``angle``."""
    last = played.estimates[-1]
    t = (to_ns(last.header.stamp) - to_ns(played.estimates[0].header.stamp)) * 1e-9
    true = shape_of(leader_at(t), follower_at(t))
    assert last.status == 1
    assert last.rho == pytest.approx(true.rho, abs=1e-3)
    assert last.alpha2 == pytest.approx(true.alpha2, abs=angle)
    assert last.v1 == pytest.approx(V1, abs=1e-3)
    assert last.alpha1 == pytest.approx(true.alpha1, abs=0.02)
    assert last.u1 == pytest.approx(U, abs=0.1)
    assert (last.v2, last.u2) == (V2, U)


@pytest.mark.parametrize("as_odometry", [False, True], ids=["PoseStamped", "Odometry"])
def test_a_bag_with_two_poses_gives_the_leaders_motion(as_odometry: bool, tmp_path: Path) -> None:
    log = bag(tmp_path, lab(as_odometry=as_odometry))
    played = replay_foreign(log, load_topic_map(str(chart(tmp_path, POSES))))
    assert len(played.estimates) == 200
    last_is_right(played)


def test_a_bag_with_mocap_frames_gives_the_leaders_motion_whatever_its_bodies_are_called(
    tmp_path: Path,
) -> None:
    log = bag(tmp_path, lab(frames=True))
    played = replay_foreign(log, load_topic_map(str(chart(tmp_path, FRAMES))))
    assert len(played.estimates) == 200
    assert not played.estimator.refused
    last_is_right(played)


def test_the_older_mocap_package_is_read_as_the_newer_one(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "old.mcap", {}) as out:
        for each in lab(frames=True):
            out.write(each.topic, typename_of(each.message), encode(each.message), each.log_ns, each.log_ns)
    log = read_log(tmp_path / "old.mcap")
    old = replace(log, topics={**log.topics, "/mocap/rigid_bodies": "mocap_msgs/msg/RigidBodies"})
    last_is_right(replay_foreign(old, load_topic_map(str(chart(tmp_path, FRAMES)))))


def test_names_on_the_command_line_win_over_the_maps(tmp_path: Path) -> None:
    wrong = FRAMES.replace('"tb-1"', '"x"').replace('"tb-2"', '"y"')
    log = bag(tmp_path, lab(frames=True))
    played = replay_foreign(log, load_topic_map(str(chart(tmp_path, wrong)), "tb-1", "tb-2"))
    last_is_right(played)


@pytest.mark.parametrize("ahead_s", [-3600.0, 0.5, 100.0])
def test_stamps_of_another_clock_do_not_make_inputs_stale_or_refused(ahead_s: float, tmp_path: Path) -> None:
    log = bag(tmp_path, lab(stamps_ns=round(ahead_s * 1e9)))
    played = replay_foreign(log, load_topic_map(str(chart(tmp_path, POSES))))
    assert not played.estimator.refused
    last_is_right(played)


def test_the_time_of_logging_can_stand_for_that_of_capture(tmp_path: Path) -> None:
    """Odometry whose stamps are an hour off is of use once everything is stamped by the log's clock."""
    sent = [
        Sent(
            each.topic,
            odometry_message(1_000_000_000, "tb2", Pose(0.0, 0.0, 0.0), Motion(V2, U)),
            each.log_ns,
        )
        if each.topic == "/tb2/odom"
        else each
        for each in lab()
    ]
    log = bag(tmp_path, sent)
    text = POSES + 'stamps = "log"\n'
    played = replay_foreign(log, load_topic_map(str(chart(tmp_path, text))))
    assert to_ns(played.estimates[0].header.stamp) == START_NS + 8_000_000
    last_is_right(played)


def test_poses_that_are_apart_in_time_make_a_frame_only_if_the_map_allows_it(tmp_path: Path) -> None:
    log = bag(tmp_path, lab(gap_ns=4_000_000))
    with pytest.raises(UsageError, match=r"within 0\.002 s \(the nearest are 0\.004 s apart\)"):
        replay_foreign(log, load_topic_map(str(chart(tmp_path, POSES))))
    allowed = chart(tmp_path, POSES + "pair_within_s = 0.005\n")
    # The follower's pose is 4 ms younger: 0.4 mm off at a distance of 0.2 m.
    last_is_right(replay_foreign(log, load_topic_map(str(allowed))), angle=0.0021)


@pytest.mark.parametrize(
    ("frames", "text", "said"),
    [
        (
            False,
            POSES.replace("/tb2/odom", "/tb2/odometry"),
            r"topic 'tb2/odometry' .* topics there: /tb2/odom",
        ),
        (False, POSES.replace("tb1/pose", "tb3/pose"), r"topic 'vrpn/tb3/pose' of map .* is not in the log"),
        (
            False,
            POSES.replace("/tb2/odom", "/vrpn/tb2/pose"),
            r"is geometry_msgs/msg/PoseStamped, expected nav",
        ),
        (True, FRAMES.replace('"tb-1"', '"tb"'), r"leader 'tb' is not among .* one of: tb-1, tb-2, wand"),
        (True, FRAMES.replace('"tb-2"', '"tb"'), r"follower 'tb' is not among .* give --follower one of"),
    ],
)
def test_what_the_map_names_and_the_log_lacks_is_answered_with_what_is_there(
    frames: bool, text: str, said: str, tmp_path: Path
) -> None:
    log = bag(tmp_path, lab(frames=frames))
    with pytest.raises(UsageError, match=said):
        replay_foreign(log, load_topic_map(str(chart(tmp_path, text))))


@pytest.mark.parametrize(
    ("topic", "said"),
    [("/tb2/odom", "has no odometry that can be read"), ("/vrpn/tb2/pose", "has no pose that can be read")],
)
def test_a_topic_that_holds_rubbish_only_is_named(topic: str, said: str, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "bad.mcap", {}) as out:
        for each in lab():
            payload = b"\0\1\0" if each.topic == topic else encode(each.message)
            out.write(each.topic, typename_of(each.message), payload, each.log_ns, each.log_ns)
    with pytest.raises(UsageError, match=said):
        replay_foreign(read_log(tmp_path / "bad.mcap"), load_topic_map(str(chart(tmp_path, POSES))))


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("source", ["auto", "mocap"])
def test_a_bag_without_odometry_gives_the_leaders_motion_all_the_same(
    named: bool, source: str, tmp_path: Path
) -> None:
    log = bag(tmp_path, [each for each in lab() if each.topic not in ("/tb2/odom", "/tb2/twist")])
    text = POSES if named else POSES.replace('odometry = "/tb2/odom"', "")
    played = replay_foreign(
        log, load_topic_map(str(chart(tmp_path, text)), None, None, [f"estimator.own_motion={source}"])
    )
    assert played.estimates[-1].v1 == pytest.approx(V1, abs=0.01)


SIGHTINGS = """
[topics]
odometry = "/tb2/odom"
sighting = ENTRY
[scenario.estimator]
sigma_range = 0.002
sigma_bearing = 0.005
"""


def sightings_map(entry: str) -> str:
    return SIGHTINGS.replace("ENTRY", entry)


def seen_by_follower(kind: str, stamp_ns: int, t: float) -> msg.Message:
    """The leader in the follower's own frame."""
    true = shape_of(leader_at(t), follower_at(t))
    if kind == "RangeBearing":
        return msg.RangeBearing(header(stamp_ns, "tb2"), true.rho, true.alpha2)
    x, y = true.rho * math.cos(true.alpha2), true.rho * math.sin(true.alpha2)
    point = msg.Point(x=x, y=y, z=0.2)
    if kind == "PointStamped":
        return PointStamped(header=header(stamp_ns, "tb2"), point=point)
    nowhere = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    return PoseStamped(header=header(stamp_ns, "tb2"), pose=msg.Pose(position=point, orientation=nowhere))


def sighting_lab(kind: str) -> list[Sent]:
    """20 s of odometry at 50 Hz and sightings at 5 Hz."""
    sent: list[Sent] = []
    for number in range(1000):
        at_ns, t = START_NS + number * 20_000_000, number * 0.02
        odometry = odometry_message(at_ns, "tb2", follower_at(t), Motion(V2, U))
        sent.append(Sent("/tb2/odom", odometry, at_ns + 1_000_000))
        if number % 10 == 0:
            sent.append(Sent("/tb2/leader", seen_by_follower(kind, at_ns, t), at_ns + 5_000_000))
    return sent


@pytest.mark.parametrize("kind", ["RangeBearing", "PointStamped", "PoseStamped"])
def test_a_topic_of_sightings_gives_the_leaders_motion(kind: str, tmp_path: Path) -> None:
    log = bag(tmp_path, sighting_lab(kind))
    mapped = load_topic_map(str(chart(tmp_path, sightings_map('"/tb2/leader"'))))
    assert mapped.scenario.estimator.front_end == "body"
    last = replay_foreign(log, mapped).estimates[-1]
    t = (to_ns(last.header.stamp) - START_NS) * 1e-9
    true = shape_of(leader_at(t), follower_at(t))
    assert last.status == 1
    assert last.rho == pytest.approx(true.rho, abs=5e-3)
    assert last.v1 == pytest.approx(V1, abs=5e-3)
    assert last.alpha1 == pytest.approx(true.alpha1, abs=0.1)


def test_a_type_that_is_told_stands_for_the_logs_own(tmp_path: Path) -> None:
    log = bag(tmp_path, sighting_lab("PointStamped"))
    entry = '{ topic = "/tb2/leader", type = "geometry_msgs/msg/Twist" }'
    mapped = load_topic_map(str(chart(tmp_path, sightings_map(entry))))
    with pytest.raises(
        UsageError, match=r"'/tb2/leader' is geometry_msgs/msg/Twist, expected .*PointStamped"
    ):
        replay_foreign(log, mapped)


def test_sightings_need_the_body_front_end_and_odometry(tmp_path: Path) -> None:
    text = sightings_map('"/tb2/leader"')
    with pytest.raises(UsageError, match="front_end = 'body'"):
        load_topic_map(str(chart(tmp_path, text + 'front_end = "world"\n')))
    with pytest.raises(UsageError, match=r"name topics\.odometry"):
        load_topic_map(str(chart(tmp_path, text.replace('odometry = "/tb2/odom"', ""))))
