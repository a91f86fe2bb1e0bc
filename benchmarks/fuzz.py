"""Mutated and random messages given to every node: none may raise, hang, or drive beyond its limits.

``python -m benchmarks.fuzz [--inputs N] [--seed S]``
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path
from types import FrameType
from typing import Any

from hil.judge.sound_messages import is_sound
from hil.live.lab_state import LabState, told_lines
from hil.live.recorder import Recorder
from hil.live.run_monitor import RunMonitor
from hil.lockstep.run import make_nodes
from hil.nodes.leader_driver import LeaderDriver
from hil.nodes.node import Node, diagnostics
from hil.nodes.source import SourceNode
from hil.nodes.start_barrier import NOBODY, StartBarrier
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import read_drive
from hil.wire.events import TICK, Event, Origin
from hil.wire.key_layout import layout_of
from hil.wire.messages import MalformedPayloadError, decode_as, encode
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.topics import Topics, link_topics, topics_of

EPOCH_NS, FRAME_NS = 1_700_000_000_000_000_000, 8_333_333
_NUMBERED = itertools.count()
_GIANTS, _STOPS, _ARMS = 0.001, 0.01, 0.05
"""How often a message is a giant, a stop is there, and robots are armed."""
_LONGEST_ROUND_S = 60
_NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 0.0, 1e12)
_LENGTHS = (0, 1, 2**31 - 1, 2**31, 2**32 - 1)
_TEXTS = (b"\0", b"\xff\xfe", b"\x1b[2J", b"a" * 300)


def mutated(payload: bytes, draw: random.Random) -> bytes:
    """A valid message with something wrong with it, or no message at all."""
    kind = draw.randrange(8)
    if kind == 0:
        return draw.randbytes(draw.randrange(200))
    if kind == 1:
        return payload[: draw.randrange(len(payload) + 1)]
    if kind == 2:
        return payload + draw.randbytes(draw.choice((1, 4, 100, 10_000)))
    data = bytearray(payload)
    place = draw.randrange(4, max(5, len(data)))
    if kind == 3:
        data[place % len(data)] ^= 1 << draw.randrange(8)
    elif kind == 4:
        place = 4 + (place - 4) // 8 * 8
        data[place : place + 8] = struct.pack("<d", draw.choice(_NUMBERS))
    elif kind == 5:
        place = place // 4 * 4
        data[place : place + 4] = struct.pack("<I", draw.choice(_LENGTHS))
    elif kind == 6:
        text = draw.choice(_TEXTS)
        data[place : place + len(text)] = text
    else:
        data[0:2] = draw.choice((b"\x00\x00", b"\x00\x03", b"\xff\xff"))
    return bytes(data)


def giant(topic: str, draw: random.Random) -> bytes:
    """A message with a text of a million characters, where a topic has texts."""
    text = draw.choice("a\u20ac") * (1 << 20)
    if topic == topics.DIAGNOSTICS:
        return encode(diagnostics(text, EPOCH_NS, text, {text: text}))
    return encode(msg.String(data=text))


class Target:
    """A node on its own state, and how often it was given something."""

    def __init__(self, node: Node[Any]) -> None:
        self.node, self.state = node, node.begin(EPOCH_NS)

    def give(self, event: Event, now_ns: int) -> list[tuple[str, bytes]]:
        """What it says to an event."""
        self.state, said = self.node.step(self.state, event, now_ns)
        return [(each.topic, each.payload) for each in said]


class Listeners:
    """Who hears everything and drives nobody: a lab's state, the start barrier, recorder and supervisor.

    The supervisor hears by a session of its own, as it does in a run. ``counts``: what was given to each.
    """

    def __init__(self, scenario: Scenario, folder: Path, held: ExitStack) -> None:
        links = links_of(scenario)
        self._lab, self._barrier = LabState(scenario), StartBarrier(frozenset({"recorder"}), links)
        self._present, self.counts, self._now_s = NOBODY, Counter[str](), 0.0
        self._recorder = Recorder(scenario, folder / "fuzzed.mcap")
        held.callback(self._recorder.close)
        self._recorder.begin(EPOCH_NS)
        self._session = open_session(Endpoints(listen=held.enter_context(reserved_endpoint())))
        held.callback(close_session, self._session)
        self._layout = layout_of(scenario)
        pairs = [link_topics(link) for link in links]
        self._monitor = RunMonitor(self._session, pairs, self._layout, [pairs[0].odom])
        held.callback(self._monitor.close)

    def hear(self, event: Event, now_ns: int) -> None:
        """Let all of them hear it."""
        self._now_s = (now_ns - EPOCH_NS) * 1e-9
        self._lab.hear(event, self._now_s)
        self.counts["lab_state"] += 1
        if event.topic in self._barrier.subscribes:
            self.counts["start_barrier"] += 1
            with suppress(MalformedPayloadError):
                self._present = self._barrier.after(self._present, event)
        if event.topic in self._recorder.subscribes:
            self._recorder.take(event, now_ns)
            self.counts["recorder"] += 1
        self._session.put(self._layout.heard(event.topic), event.payload)
        self.counts["run_monitor"] += 1

    def look(self) -> None:
        """Let those look who do so from time to time."""
        snapshot = self._monitor.update()
        snapshot.line(1.0, 2.0)
        snapshot.waits_for(["recorder"])
        for _ in told_lines(self._lab, self._now_s):
            pass


def fuzz(inputs: int, seed: int, *, guarded: bool = False) -> Counter[str]:
    """Give so many inputs to the nodes of a pair; how many each took, and how many drives were looked at.

    ``guarded``: the robots have guards. Raises whatever a node raises, AssertionError for a drive that is no
    number or beyond the limits and for an estimate that is none, and TimeoutError where a round of a hundred
    inputs takes longer than a minute.
    """
    broken: list[object] = []
    hook, sys.unraisablehook = sys.unraisablehook, broken.append
    try:
        with tempfile.TemporaryDirectory() as folder, ExitStack() as held:
            scenario = with_guards(load_scenario("turtlebot3"), present=guarded)
            counts = _rounds(scenario, Listeners(scenario, Path(folder), held), inputs, random.Random(seed))
    finally:
        sys.unraisablehook = hook
        signal.alarm(0)
    assert not broken, broken
    return counts


def _rounds(scenario: Scenario, listeners: Listeners, inputs: int, draw: random.Random) -> Counter[str]:
    counts, names = Counter[str](), topics_of(scenario)
    source = load_scenario("turtlebot3", ["source.type=TFMessage"])
    driver, poses = LeaderDriver(scenario, frozenset({"estimator", "controller"})), SourceNode(source)
    targets = [Target(node) for node in [*make_nodes(scenario), driver, poses]]
    now_ns, given = EPOCH_NS, 0
    # Nobody here sends poses of another form, stops or arms: of the first there is noise only.
    known = dict.fromkeys(poses.subscribes, bytes(60))
    known |= dict.fromkeys((topics.ARM, topics.STOP, names.side), encode(msg.String(data="follower")))
    signal.signal(signal.SIGALRM, _hangs)
    while given < inputs:
        signal.alarm(_LONGEST_ROUND_S)
        now_ns += FRAME_NS
        events = [TICK, *(_spoilt(topic, payload, draw) for topic, payload in known.items())]
        # A stop that can be read ends all driving; an arm lets it go on.
        events = [each for each in events if each.topic != topics.STOP or draw.random() < _STOPS]
        if draw.random() < _ARMS:
            events.append(Event(topics.ARM, encode(msg.String(data=""))))
        for target in targets:
            for event in events:
                if event.topic and event.topic not in target.node.subscribes:
                    continue
                said = target.give(event, now_ns)
                # What is well formed goes on its way as well, so that there is something to spoil.
                for topic, payload in said:
                    known[topic] = payload
                    counts[_checked(topic, payload, names, scenario)] += 1
                    for other in targets:
                        if topic in other.node.subscribes:
                            said += other.give(Event(topic, payload, _own()), now_ns)
                counts[target.node.name] += bool(event.topic)
                given += bool(event.topic)
        for event in events[1:]:
            listeners.hear(event, now_ns)
            given += 1
        listeners.look()
    return counts + listeners.counts


def _spoilt(topic: str, payload: bytes, draw: random.Random) -> Event:
    """A message with something wrong with it, from the sender that is obeyed or from another one."""
    who = draw.choice((_own(), None, Origin("f" * 32, 1, draw.randrange(1 << 32))))
    return Event(topic, giant(topic, draw) if draw.random() < _GIANTS else mutated(payload, draw), who)


def _own() -> Origin:
    """Of the sender that is obeyed, numbered on."""
    return Origin("e" * 32, 1, next(_NUMBERED))


def _checked(topic: str, payload: bytes, names: Topics, scenario: Scenario) -> str:
    """What kind of output it is; raises AssertionError for one that may not be."""
    if topic in (names.cmd_vel, names.wanted):
        stamped = names.stamped if topic == names.cmd_vel else names.wanted_stamped
        drive = read_drive(payload, stamped=stamped)
        assert abs(drive.v) <= scenario.controller.v_max * (1.0 + 1e-9), drive
        assert abs(drive.u) <= scenario.controller.u_max * (1.0 + 1e-9), drive
        return "drives"
    if topic == names.estimate:
        estimate = decode_as(payload, msg.LeaderEstimate)
        assert is_sound(estimate), estimate
        return "estimates"
    return "said"


def _hangs(_number: int, _frame: FrameType | None) -> None:
    raise TimeoutError(f"a round has taken longer than {_LONGEST_ROUND_S} s")


def main() -> None:
    """Fuzz without guards and with them, and print what was given to whom."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    begun = time.perf_counter()
    counts = Counter[str]()
    for guarded in (False, True):
        counts += fuzz(given.inputs // 2, given.seed + guarded, guarded=guarded)
    for name, count in sorted(counts.items()):
        sys.stdout.write(f"{name:13} {count:9}\n")
    sys.stdout.write(f"no exception, no drive beyond the limits; {time.perf_counter() - begun:.0f} s\n")


if __name__ == "__main__":
    main()
