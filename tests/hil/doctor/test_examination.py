"""The doctor finds, one by one, what is wrong in a lab: an emulated one, on a clock of the test's own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from formation.pose import Motion
from hil.doctor.check import Check
from hil.doctor.drive_checks import REST_S, Span
from hil.doctor.examination import Examination
from hil.emulator.node import EmulatorNode
from hil.errors import UsageError
from hil.nodes.findings import named_findings
from hil.nodes.node import diagnostics
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.drive_message import drive_message
from hil.wire.events import TICK, Event
from hil.wire.key_layout import layout_of
from hil.wire.lab_robots import LabRobot
from hil.wire.messages import decode_as, encode, header, typename_of
from hil.wire.pose_sources import message_of
from hil.wire.records import Placement
from hil.wire.ros_tokens import Endpoint
from hil.wire.topics import DIAGNOSTICS, RIGID_BODIES

BEGUN_NS = 1_700_000_000_000_000_000
FOLLOWER_CMD = "follower/cmd_vel"
Change = Callable[[Event, int], Sequence[tuple[Event, int]]]
"""What becomes of a message on its way: messages, each with how much later [ns] it comes."""


def as_it_is(event: Event, _number: int) -> Sequence[tuple[Event, int]]:
    return [(event, 0)]


@dataclass
class Lab:
    """An emulated lab, and a doctor who believes in ``told`` of it."""

    changes: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    change: Change = as_it_is
    graph: tuple[Endpoint, ...] = ()
    now_ns: int = BEGUN_NS
    deaf: bool = False
    waiting: list[tuple[int, int, Event]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.node = EmulatorNode(load_scenario("turtlebot3", [*self.changes]), frozenset({"nobody"}))
        self.world = self.node.begin(self.now_ns)
        self.scenario = load_scenario("turtlebot3", [*self.told])
        self.examination = Examination(self.scenario, self.now_ns)
        self.numbers = itertools.count()

    def listen(self, seconds: float) -> None:
        until_ns = self.now_ns + round(seconds * 1e9)
        while self.now_ns < until_ns:
            self.now_ns = max(self.node.due_ns(self.world), self.now_ns + 1)
            self.world, said = self.node.step(self.world, TICK, self.now_ns)
            for message in said:
                if message.topic not in self.examination.subscribes:
                    continue
                for event, later_ns in self.change(Event(message.topic, message.payload), next(self.numbers)):
                    self.waiting.append((self.now_ns + later_ns, next(self.numbers), event))
            self.waiting.sort()
            while self.waiting and self.waiting[0][0] <= self.now_ns:
                self.examination.hear(self.waiting.pop(0)[2], self.now_ns)
            self.examination.tick(self.now_ns)

    def tell(self, robot: LabRobot, motion: Motion, seconds: float) -> Span:
        begun_ns = self.now_ns
        for _ in range(round(seconds / 0.02)):
            told = drive_message(motion, self.now_ns, robot.name, stamped=True)
            if not self.deaf:
                self.world, _ = self.node.step(self.world, Event(robot.cmd_vel, encode(told)), self.now_ns)
            self.listen(0.02)
        return begun_ns + round(REST_S * 1e9), self.now_ns

    def failed(self) -> dict[str, Check]:
        layout = layout_of(self.scenario)
        checks = list(self.examination.checks(self.graph, layout, self.now_ns))
        return {each.name: each for each in checks if not each.ok}

    def looked(self, seconds: float = 2.0) -> dict[str, Check]:
        self.listen(seconds)
        return self.failed()

    def driven(self) -> dict[str, Check]:
        self.listen(0.5)
        robot = self.examination.robot("follower")
        checks = self.examination.drive(robot, self.tell)
        return {each.name: each for each in checks if not each.ok}


def frames(edit: Callable[[msg.RigidBodies, int], msg.RigidBodies | None]) -> Change:
    """A change of mocap frames; one that becomes None is lost."""

    def change(event: Event, number: int) -> Sequence[tuple[Event, int]]:
        if event.topic != RIGID_BODIES:
            return [(event, 0)]
        edited = edit(decode_as(event.payload, msg.RigidBodies), number)
        return [] if edited is None else [(Event(event.topic, encode(edited)), 0)]

    return change


def stamped(frame: msg.RigidBodies, stamp_ns: int) -> msg.RigidBodies:
    stamp = msg.Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return replace(frame, header=replace(frame.header, stamp=stamp))


def moved_in_time(by_s: float) -> Change:
    def edit(frame: msg.RigidBodies, _: int) -> msg.RigidBodies:
        return stamped(frame, frame.header.stamp.sec * 10**9 + frame.header.stamp.nanosec + round(by_s * 1e9))

    return frames(edit)


def placed(edit: Callable[[Any], Any]) -> Change:
    """A change of the poses of all bodies."""
    return frames(
        lambda frame, _: replace(
            frame, rigidbodies=[replace(body, pose=edit(body.pose)) for body in frame.rigidbodies]
        )
    )


def y_up(pose: Any) -> Any:
    at, turn = pose.position, pose.orientation
    position = replace(at, x=at.x, y=at.z, z=-at.y)
    return replace(pose, position=position, orientation=replace(turn, y=turn.z, z=-turn.y))


def in_millimetres(pose: Any) -> Any:
    at = pose.position
    return replace(pose, position=replace(at, x=1e3 * at.x, y=1e3 * at.y, z=1e3 * at.z))


def jittering(event: Event, number: int) -> Sequence[tuple[Event, int]]:
    return [(event, (number % 3) * 25_000_000 if event.topic == RIGID_BODIES else 0)]


def sender(session: str, *, publishes: bool = True, kind: type[msg.Message] = msg.TwistStamped) -> Endpoint:
    return Endpoint(session, publishes, FOLLOWER_CMD, typename_of(kind))


def odometry_of(name: str) -> Endpoint:
    return Endpoint("robot", True, f"{name}/odom", typename_of(msg.Odometry))


LISTENS = (odometry_of("follower"), sender("robot", publishes=False))
frozen: dict[str, msg.RigidBodies] = {}


def freezing(frame: msg.RigidBodies, _: int) -> msg.RigidBodies:
    first = frozen.setdefault("first", frame)
    return replace(frame, rigidbodies=[first.rigidbodies[0], *frame.rigidbodies[1:]])


def test_of_a_lab_where_all_is_well_there_is_nothing_to_say() -> None:
    lab = Lab(graph=LISTENS)
    assert lab.looked() == {}
    assert lab.driven() == {}
    assert lab.examination.findings(lab.now_ns) == []


STOPPED = frames(lambda frame, _: stamped(frame, BEGUN_NS))


@pytest.mark.parametrize(
    ("name", "lab"),
    [
        ("bodies", Lab(told=("follower.body=burger",))),
        ("frames", Lab(change=frames(lambda *_: None))),
        ("axes", Lab(change=placed(y_up))),
        ("unit", Lab(change=placed(in_millimetres))),
        ("rate", Lab(changes=("mocap.rate_hz=20",))),
        ("jitter", Lab(change=jittering)),
        ("loss", Lab(changes=("mocap.loss=0.2",))),
        ("frozen", Lab(change=frames(freezing))),
        ("clock", Lab(change=moved_in_time(5.0))),
        ("clock", Lab(change=moved_in_time(-300.0))),
        ("clock", Lab(change=STOPPED)),
        ("odometry", Lab(change=lambda event, _: [] if event.topic == "follower/odom" else [(event, 0)])),
        ("deaf_robot", Lab(graph=(odometry_of("follower"),))),
        ("command_type", Lab(graph=(LISTENS[0], sender("robot", publishes=False, kind=msg.Twist)))),
        ("senders", Lab(graph=(*LISTENS, sender("ours"), sender("stranger")))),
        ("tracked", Lab(change=frames(lambda frame, k: frame if k % 2 else replace(frame, rigidbodies=[])))),
    ],
)
def test_what_is_wrong_is_found_while_nobody_moves(name: str, lab: Lab) -> None:
    frozen.clear()
    failed = lab.looked()
    assert name in failed
    assert all(each.advice and each.seen and each.expected for each in failed.values())


def swapped(frame: msg.RigidBodies, _: int) -> msg.RigidBodies:
    first, second = frame.rigidbodies
    other = second.rigid_body_name
    bodies = [replace(first, rigid_body_name=other), replace(second, rigid_body_name=first.rigid_body_name)]
    return replace(frame, rigidbodies=bodies)


@pytest.mark.parametrize(
    ("name", "lab"),
    [
        ("deaf_robot", Lab(deaf=True)),
        ("swapped", Lab(change=frames(swapped))),
        ("frame_yaw", Lab(changes=("mocap.follower_mount=[0.0, 0.0, 0.5]",))),
        ("frame_pivot", Lab(changes=("mocap.follower_mount=[0.05, 0.0, 0.0]",))),
        ("odometry_v2", Lab(changes=("robot.odometry_scale_v=1.5",))),
        ("odometry_u2", Lab(changes=("robot.odometry_scale_u=0.5",))),
        ("odometry_v2", Lab(changes=("robot.odometry_faults=[{kind='reversed', at_s=0.0}]",))),
    ],
)
def test_what_is_wrong_with_a_robot_is_found_when_it_creeps(name: str, lab: Lab) -> None:
    if "reversed" in str(lab.changes):
        lab.change = backwards
    failed = lab.driven()
    assert name in failed
    assert all(each.advice for each in failed.values())


def backwards(event: Event, _: int) -> Sequence[tuple[Event, int]]:
    if event.topic != "follower/odom":
        return [(event, 0)]
    told = decode_as(event.payload, msg.Odometry)
    told.twist.twist.linear.x *= -1.0
    return [(Event(event.topic, encode(told)), 0)]


def test_a_robot_never_goes_beyond_what_was_promised() -> None:
    asked: list[Motion] = []

    def tell(_: LabRobot, motion: Motion, __: float) -> Span:
        asked.append(motion)
        return 0, 1

    Lab().examination.drive(Lab().examination.robot("follower"), tell)
    assert max(abs(each.v) for each in asked) <= 0.05
    assert max(abs(each.u) for each in asked) <= 0.3
    assert asked[-1] == Motion(0.0, 0.0)


def test_a_robot_that_stops_answering_in_the_middle_is_told_to_stand() -> None:
    asked: list[Motion] = []

    def tell(_: LabRobot, motion: Motion, __: float) -> Span:
        asked.append(motion)
        if len(asked) == 1:
            raise KeyboardInterrupt
        return 0, 1

    lab = Lab()
    with pytest.raises(KeyboardInterrupt):
        lab.examination.drive(lab.examination.robot("follower"), tell)
    assert asked[-1] == Motion(0.0, 0.0)


def test_robots_are_known_by_name_body_or_namespace() -> None:
    lab = Lab(told=("follower.body=2", "follower.namespace=tb3_1"))
    names = [lab.examination.robot(each).name for each in ("follower", "2", "tb3_1", "leader")]
    assert names == ["follower", "follower", "follower", "leader"]
    with pytest.raises(UsageError, match="no such robot; one of: leader, follower"):
        lab.examination.robot("burger")
    assert math.isfinite(lab.now_ns)


def test_what_a_bridge_finds_behind_it_counts_and_no_listener_of_its_own_does() -> None:
    lab = Lab(
        graph=(
            Endpoint("bridge", True, "follower/odom", "nav_msgs/msg/Odometry"),
            Endpoint("bridge", False, "follower/cmd_vel", "geometry_msgs/msg/TwistStamped"),
        )
    )
    lab.listen(1.0)
    found = named_findings({"deaf_robot": "nobody listens to /follower/cmd_vel, expected its robot to"})
    report = Event(DIAGNOSTICS, encode(diagnostics("bridge/ros2", lab.now_ns, "", found)))
    lab.examination.hear(report, lab.now_ns)
    checks = list(lab.examination.checks(lab.graph, layout_of(lab.scenario), lab.now_ns))
    (deaf,) = (each for each in checks if each.name == "deaf_robot")
    assert not deaf.ok
    assert deaf.seen == "bridge/ros2: nobody listens to /follower/cmd_vel, expected its robot to"
    assert "listens" not in {each.name for each in checks}


def test_a_leader_without_orientation_is_seen_all_the_same() -> None:
    nothing = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)

    def edit(frame: msg.RigidBodies, _: int) -> msg.RigidBodies:
        leader, follower = frame.rigidbodies
        bare = replace(leader, pose=replace(leader.pose, orientation=nothing))
        return replace(frame, rigidbodies=[bare, follower])

    assert Lab(change=frames(edit)).looked() == {}


def test_bodies_in_two_frames_of_reference_are_named_by_both() -> None:
    scenario = load_scenario("turtlebot3", ["source.type=PoseStamped"])
    examination = Examination(scenario, BEGUN_NS)
    for name in ("leader", "follower"):
        place = Placement(0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0)
        told = message_of("PoseStamped", header(BEGUN_NS, f"{name}/odom"), [(name, place)])
        examination.hear(Event(f"source/vrpn_mocap/{name}/pose", encode(told)), BEGUN_NS)
    (found,) = (
        each
        for each in examination.checks((), layout_of(scenario), BEGUN_NS)
        if each.name == "frames_of_reference"
    )
    assert "'leader' in 'leader/odom', 'follower' in 'follower/odom'" in found.seen


def test_whom_somebody_else_commands_is_not_driven_be_it_by_another_type() -> None:
    lab = Lab()
    robot = lab.examination.robot("follower")
    assert lab.examination.hindrance(robot) is None
    told = drive_message(Motion(0.1, 0.0), lab.now_ns, "follower", stamped=False)
    lab.examination.hear(Event(robot.cmd_vel, encode(told)), lab.now_ns)
    hindrance = lab.examination.hindrance(robot)
    assert hindrance is not None
    assert "1 commands of somebody else" in hindrance.seen
