"""How long the supervisor waits at the end, by a clock that only moves when somebody sleeps."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest

from hil.live import run
from hil.live.crew import Crew
from hil.live.run import STANDSTILL_TIMEOUT, _Supervisor
from hil.live.run_monitor import Snapshot
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as
from hil.wire.topics import topics_of

SCENARIO = load_scenario("turtlebot3")
PAIR, LINKS = topics_of(SCENARIO), links_of(SCENARIO)


class Lab:
    """A clock, a robot that coasts for a while, and a wire that remembers."""

    def __init__(self, coasts: float, *, seen: bool = True, emulator_until: float = 1e9) -> None:
        self.now, self.sent = 0.0, list[tuple[str, bytes]]()
        self._coasts, self._seen, self._until = coasts, seen, emulator_until

    def monotonic(self) -> float:
        return self.now

    def time_ns(self) -> int:
        return round(self.now * 1e9)

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def publish(self, topic: str, payload: bytes) -> None:
        self.sent.append((topic, payload))

    def may_publish(self, topic: str) -> bool:
        return topic in (PAIR.cmd_vel, topics.STOP)

    def update(self) -> Snapshot:
        moving = SimpleNamespace(v1=0.0, u1=0.0, v2=0.1 if self.now < self._coasts else 0.0, u2=0.0)
        return Snapshot((PAIR.follower,), truths={PAIR.follower: moving} if self._seen else {})  # type: ignore[dict-item]

    def running(self, name: str) -> bool:
        assert name == "emulator"
        return self.now < self._until


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Callable[[Lab], float]:
    def stop(lab: Lab) -> float:
        monkeypatch.setattr(run, "time", lab)
        supervisor = object.__new__(_Supervisor)
        supervisor.__dict__.update(
            _wire=lab, _monitor=lab, _children=lab, _links=LINKS, _crew=Crew(), _wheels={}
        )
        supervisor._stop("enough")
        return lab.now

    return stop


def test_it_stops_everybody_and_stands_in_for_the_controller(stopped: Callable[[Lab], float]) -> None:
    lab = Lab(0.0)
    stopped(lab)
    (stop, payload), (topic, still) = lab.sent
    assert (stop, decode_as(payload, msg.String).data) == (topics.STOP, "enough")
    assert topic == PAIR.cmd_vel
    twist = decode_as(still, msg.TwistStamped).twist
    assert (twist.linear.x, twist.angular.z) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("lab", "expected"),
    [
        (Lab(0.0), 0.0),
        (Lab(1.0), 1.0),
        (Lab(1e9), STANDSTILL_TIMEOUT),
        (Lab(1e9, seen=False), 0.0),
        (Lab(1e9, emulator_until=2.0), 2.0),
    ],
    ids=["stands", "coasts", "never stands", "was never seen", "emulator gone"],
)
def test_it_waits_for_a_standstill_and_no_longer(
    stopped: Callable[[Lab], float], lab: Lab, expected: float
) -> None:
    # A glance for whatever is still on its way comes on top.
    assert expected < stopped(lab) < expected + 0.2


def test_ten_seconds_are_the_longest() -> None:
    assert STANDSTILL_TIMEOUT == 10.0
