"""A follower that needs the recorder uses nothing before it is there, and hears orders all the same."""

from __future__ import annotations

from collections.abc import Sequence

from hil.live.held_worker import HeldWorker
from hil.live.node_worker import NodeWorker
from hil.lockstep.run import make_nodes
from hil.nodes.node import Outgoing, diagnostics, outgoing
from hil.scenario.files import load_scenario
from hil.scenario.links import Link, links_of
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.message_types import Command, LeaderEstimate, String
from hil.wire.messages import decode_as

PAIR = load_scenario("turtlebot3")
TICK_NS = 20_000_000
ESTIMATES = topics.link_topics(Link(PAIR)).estimate


class Lab:
    """An emulated lab around a follower that needs the recorder, step by step."""

    def __init__(self) -> None:
        emulator, *nodes = make_nodes(PAIR)
        self.said: list[str] = []
        follower = NodeWorker(nodes, within=(ESTIMATES,), clock=lambda: self.now_ns)
        self.held = HeldWorker(follower, frozenset({"recorder"}), links_of(PAIR), self.said.append)
        self.emulator, self.now_ns = emulator, 0
        self.world = emulator.begin(0)
        self.held.begin(0)

    def drive(self, duration_ns: int) -> list[Outgoing]:
        """All that the follower says in a time."""
        out: list[Outgoing] = []
        until_ns = self.now_ns + duration_ns
        while self.now_ns < until_ns:
            self.now_ns = self.emulator.due_ns(self.world)
            self.world, sent = self.emulator.step(self.world, TICK, self.now_ns)
            out += self.hear(TICK)
            for message in sent:
                out += self.hear(Event(message.topic, message.payload))
        return out

    def hear(self, event: Event) -> list[Outgoing]:
        """What the follower says to an arrival."""
        return list(self.held.take(event, self.now_ns))

    def report(self, problem: str = "") -> None:
        """The recorder says how it is."""
        said = outgoing(topics.DIAGNOSTICS, diagnostics("recorder", self.now_ns, problem, {}), self.now_ns)
        assert self.hear(Event(said.topic, said.payload)) == []


def commands(said: Sequence[Outgoing]) -> list[Command]:
    return [decode_as(each.payload, Command) for each in said if each.topic == "follower/command"]


def test_nothing_is_used_before_the_recorder_is_well() -> None:
    lab = Lab()
    before = lab.drive(900_000_000)
    assert lab.said == []
    lab.hear(Event(topics.DIAGNOSTICS, b"no report"))
    lab.report("the disk is gone")
    before += lab.drive(200_000_000)
    assert not [each for each in before if each.topic == ESTIMATES]
    assert {each.stop for each in commands(before)} == {"no estimate"}
    lab.report()
    after = lab.drive(300_000_000)
    estimates = [decode_as(each.payload, LeaderEstimate) for each in after if each.topic == ESTIMATES]
    assert len(estimates) > 20
    # What its first estimate rests on came later, so that a log has all of it.
    assert (
        min(each.received.sec * 10**9 + each.received.nanosec for each in estimates[0].consumed)
        > 1_100_000_000
    )
    assert lab.said == [
        "uses no measurements before it hears that all is well with recorder",
        "all is well with recorder: begins",
    ]


def test_who_was_there_is_not_waited_for_again() -> None:
    lab = Lab()
    lab.report()
    lab.report("the disk is gone")
    assert [each for each in lab.drive(200_000_000) if each.topic == ESTIMATES]


def test_a_stop_is_heard_while_measurements_are_not() -> None:
    lab = Lab()
    stop = outgoing(topics.STOP, String(data="enough"), 0)
    lab.hear(Event(stop.topic, stop.payload))
    said = commands(lab.drive(100_000_000))
    assert said
    assert {each.stop for each in said[1:]} == {"stopped"}
