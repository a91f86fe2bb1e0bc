"""Nodes as the worker of a daemon: who hears what, when each is due, and how they part."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hil.nodes.node import Node, Outgoing, outgoing
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.message_types import String

_LONGEST_TICK_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class Parting:
    """How nodes that drive robots leave.

    ``reason``: of the stop message that they publish and are told, like everybody else: so a controller's
    last command is a standstill, and the log holds the reason. ``standstill``: at a time, what makes all
    their robots stand without them, should one break down even then, or where they do not ``stop_all``: keys
    may leave orders to operators and guards, and what was not said to all no log would hold.
    """

    reason: str
    standstill: Callable[[int], Iterable[Outgoing]]
    stop_all: bool = True


class NodeWorker:
    """Carries the states of nodes from step to step: one node, or those of many followers.

    ``within``: topics on which one of the nodes speaks to another. Such a message goes to its listeners at
    once, and each takes it in at a time of its own, by ``clock`` [ns]; it is published before what they
    make of it, and nobody here listens to these topics on the wire. ``unspoken``: those of them that nobody
    else is to hear. ``after_tick``: called after every tick.
    ``on_report``: called with the diagnostics of every node.
    """

    thorough = False

    def __init__(
        self,
        nodes: Iterable[Node[Any]],
        within: Collection[str] = (),
        parting: Parting | None = None,
        clock: Callable[[], int] = time.time_ns,
        after_tick: Callable[[], None] = lambda: None,
        on_report: Callable[[bytes], None] = lambda _: None,
        unspoken: Collection[str] = (),
    ) -> None:
        # Listeners first: where all tick at once they have had theirs before they hear, later, of another's.
        self.nodes = tuple(sorted(nodes, key=lambda node: set(within).isdisjoint(node.subscribes)))
        self._readers = _readers(self.nodes)
        self._within = {topic: self._readers[topic] for topic in within if topic in self._readers}
        self.subscribes = tuple(topic for topic in self._readers if topic not in self._within)
        self._parting, self._clock, self._after_tick = parting, clock, after_tick
        self._on_report, self._unspoken = on_report, unspoken
        self._states: list[Any] = []
        self._dues: list[int] = []
        self._now_ns = 0

    def begin(self, now_ns: int) -> None:
        """Let the nodes come up."""
        self._now_ns = now_ns
        self._states = [node.begin(now_ns) for node in self.nodes]
        self._dues = [node.due_ns(state) for node, state in zip(self.nodes, self._states, strict=True)]

    def due_ns(self) -> int:
        """Time of the next tick of any node."""
        return min(self._dues)

    def take(self, event: Event, now_ns: int) -> Iterator[Outgoing]:
        """One step of every node that listens to an arrival or, at a tick, is due.

        At a tick after the clock was set back all are: nobody may wait until it is there again. Where the
        reports of many are due at once, some are left for the next tick: an arrival goes first.
        """
        set_back, self._now_ns = now_ns < self._now_ns, now_ns
        if event.topic:
            for place in self._readers.get(event.topic, ()):
                yield from self._step(place, event, now_ns)
            return
        self._after_tick()
        if set_back:
            for place in range(len(self.nodes)):
                yield from self._step(place, event, now_ns)
            return
        until_ns = self._clock() + _LONGEST_TICK_NS
        dues = self._dues
        due = [place for place, due_ns in enumerate(dues) if due_ns <= now_ns]
        for place in sorted(due, key=dues.__getitem__):
            # Who has just heard of another's tick needs none any more.
            if dues[place] <= now_ns:
                yield from self._step(place, event, now_ns)
            if self._clock() > until_ns:
                return

    def end(self, now_ns: int) -> Iterator[Outgoing]:
        """The parting stop or standstill, if any, and the nodes' final reports."""
        if self._parting is not None and not self._parting.stop_all:
            yield from self._parting.standstill(now_ns)
        elif self._parting is not None:
            stop = outgoing(topics.STOP, String(data=self._parting.reason), now_ns)
            yield stop
            try:
                yield from self.take(Event(stop.topic, stop.payload), now_ns)
            except Exception:
                yield from self._parting.standstill(now_ns)
                raise
        for node, state in zip(self.nodes, self._states, strict=True):
            yield node.report(state, now_ns)

    def _step(self, place: int, event: Event, now_ns: int) -> Iterator[Outgoing]:
        node = self.nodes[place]
        state, said = node.step(self._states[place], event, now_ns)
        self._states[place], self._dues[place] = state, node.due_ns(state)
        for message in said:
            if message.topic not in self._unspoken:
                yield message
            if message.topic == topics.DIAGNOSTICS:
                self._on_report(message.payload)
            if listeners := self._within.get(message.topic):
                heard = Event(message.topic, message.payload)
                for listener in listeners:
                    yield from self._step(listener, heard, self._clock())


def _readers(nodes: Sequence[Node[Any]]) -> dict[str, list[int]]:
    """Places of the nodes that listen to each topic."""
    readers: dict[str, list[int]] = {}
    for place, node in enumerate(nodes):
        for topic in node.subscribes:
            readers.setdefault(topic, []).append(place)
    return readers
