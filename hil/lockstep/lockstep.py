"""Lockstep: all nodes in one process on a simulated clock, as fast as it goes.

The same seed gives the same bytes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hil.nodes.node import Node, Outgoing
from hil.wire.events import TICK, Event

EPOCH_NS = 1_767_225_600_000_000_000
"""Where simulated time begins: 2026-01-01 00:00 UTC, so that tools show a plausible date."""

Sink = Callable[[Outgoing, int], None]


class Lockstep:
    """Runs nodes against each other. Messages arrive in no time, in the order in which they were sent.

    ``sink`` is called for every message with the simulated time at which it was published.
    """

    def __init__(self, nodes: list[Node[Any]], sink: Sink, begin_ns: int = EPOCH_NS) -> None:
        self.nodes = nodes
        self.sink = sink
        self.now_ns = begin_ns
        self.states: list[Any] = [node.begin(begin_ns) for node in nodes]
        self._readers: dict[str, list[int]] = {}
        for index, node in enumerate(nodes):
            for topic in node.subscribes:
                self._readers.setdefault(topic, []).append(index)

    def state_of(self, name: str) -> Any:
        """State of the node with the given name."""
        return next(state for node, state in zip(self.nodes, self.states, strict=True) if node.name == name)

    def run_until(self, end_ns: int) -> None:
        """Let time pass until ``end_ns``: tick whichever node is due first; equal times go in node order."""
        while True:
            dues = [node.due_ns(state) for node, state in zip(self.nodes, self.states, strict=True)]
            first = min(dues)
            if first > end_ns:
                self.now_ns = end_ns
                return
            self.now_ns = max(self.now_ns, first)
            if messages := self._step(dues.index(first), TICK):
                self._deliver(messages)

    def publish(self, message: Outgoing) -> None:
        """Send a message from outside, as an operator would."""
        self._deliver((message,))

    def farewell(self) -> None:
        """Let every node say its last word."""
        for node, state in zip(self.nodes, self.states, strict=True):
            self.sink(node.report(state, self.now_ns), self.now_ns)

    def _step(self, index: int, event: Event) -> tuple[Outgoing, ...]:
        self.states[index], out = self.nodes[index].step(self.states[index], event, self.now_ns)
        return out

    def _deliver(self, messages: tuple[Outgoing, ...]) -> None:
        waiting, now_ns = deque(messages), self.now_ns
        while waiting:
            message = waiting.popleft()
            self.sink(message, now_ns)
            if readers := self._readers.get(message.topic):
                event = Event(message.topic, message.payload)
                for index in readers:
                    waiting.extend(self._step(index, event))
