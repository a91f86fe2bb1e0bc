"""Who must be there before a leader sets off."""

from __future__ import annotations

import pytest

from hil.nodes.node import diagnostics
from hil.nodes.start_barrier import NOBODY, StartBarrier
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, encode, header

LINKS = links_of(load_scenario("chain5-turtlebot3", ["chain.agents=3"]))
BARRIER = StartBarrier(frozenset({"follower", "recorder"}), LINKS)
NODES = ("estimator/follower", "estimator/agent3", "controller/follower", "controller/agent3", "recorder")


def report(name: str, problem: str = "") -> Event:
    return Event(topics.DIAGNOSTICS, encode(diagnostics(name, 1, problem, {})))


def command(follower: str) -> Event:
    nothing = msg.Vector3(x=0.0, y=0.0, z=0.0)
    twist = msg.TwistStamped(header=header(1, ""), twist=msg.Twist(linear=nothing, angular=nothing))
    return Event(f"{follower}/cmd_vel", encode(twist))


ALL = [*map(report, NODES), command("follower"), command("agent3")]


@pytest.mark.parametrize("missing", range(len(ALL)))
def test_it_opens_when_the_last_one_is_there_and_names_who_is_not(missing: int) -> None:
    present = NOBODY
    for place, event in enumerate(ALL):
        if place != missing:
            present = BARRIER.after(present, event)
    assert not BARRIER.is_open(present)
    assert (
        BARRIER.waits_for(present)
        == f"waiting for {[*NODES, 'a command to follower', 'a command to agent3'][missing]}"
    )
    present = BARRIER.after(present, ALL[missing])
    assert BARRIER.is_open(present)
    assert BARRIER.waits_for(present) == ""


def test_who_reports_a_problem_is_not_there_any_more() -> None:
    present = NOBODY
    for event in ALL:
        present = BARRIER.after(present, event)
    present = BARRIER.after(present, report("recorder", "the disk is full"))
    assert BARRIER.waits_for(present) == "waiting for recorder"
    assert BARRIER.is_open(BARRIER.after(present, report("recorder")))


def test_strangers_do_not_count() -> None:
    assert BARRIER.after(NOBODY, report("emulator")) == NOBODY


@pytest.mark.parametrize("topic", [topics.DIAGNOSTICS, "agent3/cmd_vel"])
def test_what_cannot_be_read_is_said_to_be_so(topic: str) -> None:
    with pytest.raises(MalformedPayloadError):
        BARRIER.after(NOBODY, Event(topic, b"\x01\x02"))
