"""Microseconds of a node's step, from bytes to bytes, with the compiled EKF and with filterpy's.

    python benchmarks/node_step.py [--duration 10] [--repeats 5]

What each node of ``turtlebot3`` took in during a run in lockstep is put through it again, nothing else around
it; the digests that receipts need are made beforehand, as a process makes them once. The two take turns, and
the figures are medians of processor time.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.lockstep.run import make_nodes
from hil.nodes.node import Node
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.events import Event

KINDS = ("ekf", "ekf-filterpy")
Taken = list[tuple[Event, int]]


class Listening:
    """A node that keeps what it takes in."""

    def __init__(self, node: Node[Any]) -> None:
        self.node, self.name, self.subscribes = node, node.name, node.subscribes
        self.begin, self.due_ns, self.report = node.begin, node.due_ns, node.report
        self.taken: Taken = []

    def step(self, state: Any, event: Event, now_ns: int) -> Any:
        self.taken.append((event, now_ns))
        return self.node.step(state, event, now_ns)


def events_of(kind: str, duration: float) -> list[Listening]:
    nodes = [Listening(node) for node in make_nodes(load_scenario("turtlebot3", [f"estimator.kind={kind}"]))]
    lockstep = Lockstep(list(nodes), lambda message, now_ns: None)
    lockstep.run_until(EPOCH_NS + round(duration * 1e9))
    return nodes


def per_step_us(listening: Listening, topic: str) -> float:
    """Microseconds of the steps on a topic; the others happen as well."""
    node, total, count = listening.node, 0.0, 0
    state = node.begin(EPOCH_NS)
    for event, now_ns in listening.taken:
        begun = time.process_time_ns()
        state, _ = node.step(state, event, now_ns)
        if event.topic == topic:
            total += time.process_time_ns() - begun
            count += 1
    return 1e-3 * total / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    nodes = {kind: events_of(kind, given.duration) for kind in KINDS}
    rows = [
        ("estimator, frame", 1, topics.RIGID_BODIES),
        ("estimator, odometry", 1, "follower/odom"),
        ("controller, estimate", 2, "follower/leader_estimate"),
    ]
    print(f"{'us per step':<22}" + "".join(f"{kind:>14}" for kind in KINDS) + "   ratio")
    for name, place, topic in rows:
        found: dict[str, list[float]] = {kind: [] for kind in KINDS}
        for _ in range(given.repeats):
            for kind in KINDS:
                found[kind].append(per_step_us(nodes[kind][place], topic))
        ekf, peer = (median(found[kind]) for kind in KINDS)
        print(f"{name:<22}{ekf:14.1f}{peer:14.1f}   {peer / ekf:5.1f}")


if __name__ == "__main__":
    main()
