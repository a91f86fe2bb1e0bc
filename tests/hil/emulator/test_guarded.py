"""Emulated followers obey their guards, and nobody else."""

from __future__ import annotations

import pytest

from formation.pose import STANDSTILL, Motion
from hil.emulator.node import EmulatorNode, EmulatorState
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.findings import findings_in
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.events import TICK, Event, Origin
from hil.wire.messages import decode_as, encode

MS = 1_000_000
NODE = EmulatorNode(with_guards(load_scenario("chain5-turtlebot3")))
FORWARD = Motion(0.1, 0.0)


def wanted(robot: str, at_ms: int, number: int, motion: Motion = FORWARD, session: str = "aa") -> Event:
    told = drive_message(motion, EPOCH_NS + at_ms * MS, robot, stamped=True)
    return Event(f"{robot}/cmd_vel_wanted", encode(told), Origin(session, 1, number))


def after(state: EmulatorState, at_ms: int, event: Event = TICK) -> list[Outgoing]:
    """Let time pass until then, and something happen."""
    said: list[Outgoing] = []
    while NODE.due_ns(state) < EPOCH_NS + at_ms * MS:
        said += NODE.step(state, TICK, NODE.due_ns(state))[1]
    return [*said, *NODE.step(state, event, EPOCH_NS + at_ms * MS)[1]]


def told(said: list[Outgoing], robot: str) -> list[Motion]:
    return [read_drive(each.payload, stamped=True) for each in said if each.topic == f"{robot}/cmd_vel"]


def goals(state: EmulatorState) -> list[Motion]:
    return [robot.goal for robot in state.robots[1:]]


def driven() -> EmulatorState:
    """A chain whose second follower drives, at 20 ms."""
    state = NODE.begin(EPOCH_NS)
    after(state, 0, wanted("agent3", 0, 1, STANDSTILL))
    said = after(state, 20, wanted("agent3", 20, 2))
    assert told(said, "agent3")[-1] == FORWARD
    assert goals(state) == [STANDSTILL, FORWARD, STANDSTILL, STANDSTILL]
    return state


def test_a_robot_stands_when_nothing_fresh_comes_and_is_told_so() -> None:
    state = driven()
    after(state, 165)
    assert FORWARD in goals(state)
    said = after(state, 185)
    assert told(said, "agent3")[-1] == STANDSTILL
    assert goals(state) == [STANDSTILL] * 4


@pytest.mark.parametrize("name", ["agent3", ""])
def test_a_second_sender_holds_it_until_it_is_armed(name: str) -> None:
    state = driven()
    after(state, 30, wanted("agent3", 30, 1, Motion(0.2, 1.0), "bb"))
    assert goals(state) == [STANDSTILL] * 4
    reports = [each.payload for each in after(state, 600) if each.topic == topics.DIAGNOSTICS]
    found = {node: each for payload in reports for node, each in _found(payload).items()}
    assert "session bb" in found["guard/agent3"]["second_sender"]
    assert not found["guard/agent4"]
    after(state, 610, Event(topics.ARM, encode(msg.String(data="agent5")), Origin("op", 1, 1)))
    after(state, 620, wanted("agent3", 620, 3))
    assert goals(state) == [STANDSTILL] * 4
    after(state, 630, Event(topics.ARM, encode(msg.String(data=name)), Origin("op", 1, 2)))
    after(state, 640, wanted("agent3", 640, 4))
    assert goals(state)[1] == FORWARD


def test_nobody_drives_a_robot_past_its_guard() -> None:
    state = driven()
    assert "agent3/cmd_vel" not in NODE.subscribes
    after(state, 30, Event("agent3/cmd_vel", encode(drive_message(FORWARD, EPOCH_NS, "", stamped=True))))
    assert goals(state)[1] == FORWARD
    after(state, 30, Event("agent4/cmd_vel", encode(drive_message(FORWARD, EPOCH_NS, "", stamped=True))))
    assert goals(state)[2] == STANDSTILL


def test_frames_are_looked_at_where_there_is_a_fence() -> None:
    scenario = with_guards(load_scenario("turtlebot3", ["guard.fence=[90.0, 90.0, 91.0, 91.0]"]))
    node = EmulatorNode(scenario)
    state, said = node.begin(EPOCH_NS), list[Outgoing]()
    while node.due_ns(state) < EPOCH_NS + 800 * MS:
        said += node.step(state, TICK, node.due_ns(state))[1]
    reports = [_found(each.payload) for each in said if each.topic == topics.DIAGNOSTICS]
    texts = [each["guard/follower"].get("guard_latched", "") for each in reports if "guard/follower" in each]
    assert "outside its fence" in texts[-1]


def _found(payload: bytes) -> dict[str, dict[str, str]]:
    return findings_in(decode_as(payload, msg.DiagnosticArray))
