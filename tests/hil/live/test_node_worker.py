"""Nodes that share a process: each does what it would do alone, and all their robots stand when it ends."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import pytest

from formation.pose import STANDSTILL
from hil.live.finding_lines import FindingLines
from hil.live.node_worker import NodeWorker, Parting
from hil.lockstep.run import make_nodes
from hil.nodes.link_nodes import controller_node, estimator_node, standstill
from hil.nodes.node import Node, Outgoing, diagnostics, outgoing
from hil.scenario.files import load_scenario
from hil.scenario.links import Link, links_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import read_drive
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, to_ns

CHAIN = load_scenario("chain5-turtlebot3", ["chain.agents=3"])
HALF_A_SECOND_NS = 500_000_000


def test_nodes_that_share_a_process_do_what_they_would_do_alone() -> None:
    emulator, *estimators = make_nodes(CHAIN)[:3]
    # By a clock that stands no report is left for the next tick.
    together = NodeWorker(estimators, clock=lambda: 0)
    alone = [NodeWorker([node]) for node in estimators]
    world, now_ns = emulator.begin(0), 0
    for worker in (together, *alone):
        worker.begin(0)
    said = [0, 0]
    while now_ns < HALF_A_SECOND_NS:
        now_ns = emulator.due_ns(world)
        world, sent = emulator.step(world, TICK, now_ns)
        events = [TICK, *(Event(message.topic, message.payload) for message in sent)]
        for event in events:
            each = [tuple(worker.take(event, now_ns)) for worker in alone]
            assert tuple(together.take(event, now_ns)) == tuple(message for out in each for message in out)
            said = [count + len(out) for count, out in zip(said, each, strict=True)]
    assert min(said) > 50
    assert together.due_ns() == min(worker.due_ns() for worker in alone)
    assert len(tuple(together.end(now_ns))) == 2


class Clock:
    """A nanosecond later each time that it is looked at."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        self.now_ns += 1
        return self.now_ns


def together(links: Iterable[Link], clock: Clock) -> NodeWorker:
    controllers = [controller_node(link) for link in links]
    estimates = [node.topics.estimate for node in controllers]
    return NodeWorker([*map(estimator_node, links), *controllers], within=estimates, clock=clock)


def test_a_controller_in_the_same_process_hears_each_estimate_at_once_and_at_a_time_of_its_own() -> None:
    links, clock = links_of(CHAIN), Clock()
    followers = together(links, clock)
    assert not {f"{link.follower}/leader_estimate" for link in links} & set(followers.subscribes)
    emulator = make_nodes(CHAIN)[0]
    followers.begin(0)
    world, heard = emulator.begin(0), dict.fromkeys((link.follower for link in links), 0)
    while clock.now_ns < HALF_A_SECOND_NS:
        clock.now_ns = max(clock.now_ns, emulator.due_ns(world))
        now_ns = clock.now_ns
        world, sent = emulator.step(world, TICK, now_ns)
        for event in (TICK, *(Event(message.topic, message.payload) for message in sent)):
            said = list(followers.take(event, now_ns))
            for first, second in itertools.pairwise(said):
                if not first.topic.endswith("/leader_estimate"):
                    continue
                who = first.topic.partition("/")[0]
                assert second.topic == f"{who}/cmd_vel"
                decided = next(each for each in said[said.index(first) :] if each.topic == f"{who}/command")
                decision = decode_as(decided.payload, msg.Command)
                consumed = [each.digest for each in decision.consumed]
                assert consumed == [Event(first.topic, first.payload).digest]
                assert to_ns(decision.consumed[0].received) > now_ns
                heard[who] += 1
    assert min(heard.values()) > 25


class Brittle:
    """A node that breaks down at a stop."""

    name = "brittle"
    subscribes: tuple[str, ...] = (topics.STOP,)

    def begin(self, now_ns: int) -> int:
        return 0

    def due_ns(self, state: int) -> int:
        return 0

    def report(self, state: int, now_ns: int) -> Outgoing:
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, "", {}), now_ns)

    def step(self, state: int, event: Event, now_ns: int) -> tuple[int, tuple[Outgoing, ...]]:
        raise ZeroDivisionError("at a stop")


def test_if_a_node_breaks_down_at_the_end_too_all_robots_are_told_zero_and_the_error_is_told() -> None:
    links = links_of(CHAIN)
    parting = Parting("the end", lambda now_ns: [standstill(link, now_ns) for link in links])
    nodes: list[Node[Any]] = [Brittle(), *map(controller_node, links)]
    worker = NodeWorker(nodes, parting=parting)
    worker.begin(0)
    said, saying = list[Outgoing](), worker.end(1)
    with pytest.raises(ZeroDivisionError):
        said.extend(saying)
    drives = [each for each in said if each.topic.endswith("/cmd_vel")]
    assert {each.topic for each in drives} == {f"{link.follower}/cmd_vel" for link in links}
    assert all(read_drive(each.payload, stamped=True) == STANDSTILL for each in drives)


def test_the_last_command_of_every_follower_is_a_standstill_with_the_reason() -> None:
    links = links_of(CHAIN)
    parting = Parting("the end", lambda now_ns: [])
    worker = NodeWorker(map(controller_node, links), parting=parting)
    worker.begin(0)
    stop, *said = worker.end(1)
    assert decode_as(stop.payload, msg.String).data == "the end"
    for link in links:
        drive = next(each for each in said if each.topic == f"{link.follower}/cmd_vel")
        assert read_drive(drive.payload, stamped=True) == STANDSTILL


class Finder:
    """A node that reports at every tick, and finds something at the second."""

    name = "finder"
    subscribes: tuple[str, ...] = ()

    def begin(self, now_ns: int) -> int:
        return 0

    def due_ns(self, state: int) -> int:
        return 0

    def report(self, state: int, now_ns: int) -> Outgoing:
        found = {"finding.clock": "an hour behind"} if state == 2 else {}
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, "", found), now_ns)

    def step(self, state: int, event: Event, now_ns: int) -> tuple[int, tuple[Outgoing, ...]]:
        return state + 1, (self.report(state + 1, now_ns),)


def test_what_a_node_finds_is_said_where_it_runs() -> None:
    lines = list[str]()
    worker = NodeWorker([Finder()], on_report=FindingLines(lines.append).hear)
    worker.begin(0)
    for now_ns in (1, 2, 3):
        list(worker.take(TICK, now_ns))
    begun, ended = lines
    assert begun.startswith("finder finds clock: an hour behind; ")
    assert ended == "finder finds clock no more"


def test_who_may_not_stop_all_lets_its_own_robots_stand_and_hears_no_stop_that_no_log_holds() -> None:
    links = links_of(load_scenario("chain5"))
    parting = Parting("the end", lambda now_ns: [standstill(link, now_ns) for link in links], stop_all=False)
    worker = NodeWorker(map(controller_node, links), parting=parting)
    worker.begin(0)
    said = list(worker.end(1))
    still = [standstill(link, 1) for link in links]
    assert said[: len(links)] == still
    assert {each.topic for each in said[len(links) :]} == {topics.DIAGNOSTICS}
