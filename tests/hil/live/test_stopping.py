from __future__ import annotations

from typing import cast

import pytest

from formation.pose import STANDSTILL, Motion
from hil.live import stopping
from hil.live.coming_to_rest import Rest
from hil.live.stopping import TIMES, Stopped, say_stop, stop_all
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.pubsub import Inbox, Wire

SCENARIO = load_scenario("turtlebot3")
ROBOTS = ("leader/cmd_vel", "follower/cmd_vel")


class BrokenWire:
    """A wire that cannot bring over some topics, as often as it is told."""

    def __init__(self, broken: str, failures: int) -> None:
        self.broken, self.failures = broken, failures
        self.said: list[str] = []
        self.inbox = Inbox()

    def subscribe(self, *_: object, **__: object) -> None:
        """Nothing comes."""

    def may_publish(self, _: str) -> bool:
        return True

    def publish(self, topic: str, _: bytes) -> None:
        if topic == self.broken and self.failures:
            self.failures -= 1
            raise OSError("broken")
        self.said.append(topic)


def wire_without(broken: str, failures: int) -> tuple[BrokenWire, Wire]:
    wire = BrokenWire(broken, failures)
    return wire, cast("Wire", wire)


def test_robots_are_told_to_stand_where_the_stop_itself_cannot_be_said() -> None:
    broken, wire = wire_without(topics.STOP, 1)
    with pytest.raises(OSError, match="broken"):
        say_stop(wire, SCENARIO, "by hand")
    assert broken.said == [*ROBOTS]


def test_a_stop_that_could_not_be_said_at_first_is_said_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stopping, "_PATIENCE_S", 0.0)
    broken, wire = wire_without(topics.STOP, TIMES - 1)
    assert not stop_all(wire, SCENARIO, "by hand").done
    assert broken.said.count(topics.STOP) == 1
    assert [broken.said.count(each) for each in ROBOTS] == [TIMES, TIMES]


def test_a_stop_that_could_never_be_said_is_no_verdict_but_all_tries_were_made() -> None:
    broken, wire = wire_without(topics.STOP, TIMES)
    with pytest.raises(OSError, match="broken"):
        stop_all(wire, SCENARIO, "by hand")
    assert [broken.said.count(each) for each in ROBOTS] == [TIMES, TIMES]


def test_who_is_driven_and_who_is_not_heard_are_both_named_with_what_to_do() -> None:
    line = Stopped("by hand", ("a", "b", "c"), ("a",), ("b", "c")).line()
    assert line == "somebody still drives a; nothing was heard of b, c on this wire; use the robot's switch"
    assert Stopped("by hand", ("a", "b"), (), ()).line() == "a, b told to stand (by hand)"


def test_who_moves_on_by_its_odometry_was_not_stopped() -> None:
    stands, moves = Rest("a", STANDSTILL, 0.3), Rest("b", Motion(0.12, 0.0))
    done = Stopped("by hand", ("a", "b"), rest=(stands, Rest("b")))
    assert done.done
    assert done.line() == (
        "a, b told to stand (by hand): a stands (odometry 0.000 m/s, 0.00 rad/s after 0.3 s), "
        "b: nothing heard of its odometry: look at the robot"
    )
    failed = Stopped("by hand", ("a", "b"), rest=(stands, moves))
    assert not failed.done
    assert failed.line() == (
        "a stands (odometry 0.000 m/s, 0.00 rad/s after 0.3 s), "
        "b was told to stand and still moves at 0.12 m/s; use the robot's switch"
    )


def test_who_did_stop_is_named_where_the_robots_are_others() -> None:
    stopped = Stopped("by hand", ("a",), unheard=("a",), nodes=("controller", "guard/z"))
    assert stopped.line() == (
        "nothing was heard of a on this wire; controller, guard/z did stop; use the robot's switch"
    )
