"""Mutated and random messages given to every node: none may raise, hang, or drive beyond its limits.

``python -m benchmarks.fuzz [--inputs N] [--seed S]``
"""

from __future__ import annotations

import argparse
import math
import random
import struct
import sys
import time
from collections import Counter
from typing import Any

from hil.live.lab_state import LabState
from hil.lockstep.run import make_nodes
from hil.nodes.leader_driver import LeaderDriver
from hil.nodes.node import Node
from hil.nodes.source import SourceNode
from hil.scenario.files import load_scenario
from hil.wire.drive_message import read_drive
from hil.wire.events import TICK, Event
from hil.wire.topics import topics_of

EPOCH_NS, FRAME_NS = 1_700_000_000_000_000_000, 8_333_333
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


class Target:
    """A node on its own state, and how often it was given something."""

    def __init__(self, node: Node[Any]) -> None:
        self.node, self.state = node, node.begin(EPOCH_NS)

    def give(self, event: Event, now_ns: int) -> list[tuple[str, bytes]]:
        """What it says to an event."""
        self.state, said = self.node.step(self.state, event, now_ns)
        return [(each.topic, each.payload) for each in said]


def fuzz(inputs: int, seed: int) -> Counter[str]:
    """Give so many inputs to the nodes of a pair; how many each took, and how many drives were looked at.

    Raises whatever a node raises, and AssertionError for a drive that is no number or beyond the limits.
    """
    scenario, draw, counts = load_scenario("turtlebot3"), random.Random(seed), Counter[str]()
    names, lab = topics_of(scenario), LabState(scenario)
    source = load_scenario("turtlebot3", ["source.type=TFMessage"])
    others = [LeaderDriver(scenario, frozenset({"estimator", "controller"})), SourceNode(source)]
    targets = [Target(node) for node in (*make_nodes(scenario), *others)]
    limit, turn = scenario.controller.v_max, scenario.controller.u_max
    now_ns, given, known = EPOCH_NS, 0, dict[str, bytes]()
    # Nobody here sends poses of another form: of these there is noise only.
    known |= dict.fromkeys(others[1].subscribes, bytes(60))
    while given < inputs:
        now_ns += FRAME_NS
        events = [TICK, *(Event(topic, mutated(payload, draw)) for topic, payload in known.items())]
        for target in targets:
            for event in events:
                if event.topic and event.topic not in target.node.subscribes:
                    continue
                for topic, payload in target.give(event, now_ns):
                    known[topic] = payload
                    # What is well formed goes on its way as well, so that there is something to spoil.
                    for other in targets:
                        if topic in other.node.subscribes:
                            other.give(Event(topic, payload), now_ns)
                    if topic == names.cmd_vel:
                        drive = read_drive(payload, stamped=names.stamped)
                        assert abs(drive.v) <= limit * (1.0 + 1e-9), drive
                        assert abs(drive.u) <= turn * (1.0 + 1e-9), drive
                        counts["drives"] += 1
                counts[target.node.name] += bool(event.topic)
                given += bool(event.topic)
        for event in events[1:]:
            lab.hear(event, (now_ns - EPOCH_NS) * 1e-9)
            counts["lab_state"] += 1
            given += 1
    return counts


def main() -> None:
    """Fuzz, and print what was given to whom."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    begun = time.perf_counter()
    counts = fuzz(given.inputs, given.seed)
    for name, count in sorted(counts.items()):
        sys.stdout.write(f"{name:12} {count:9}\n")
    sys.stdout.write(f"no exception, no drive beyond the limits; {time.perf_counter() - begun:.0f} s\n")


if __name__ == "__main__":
    main()
