"""A worker that uses nothing before others are there: what a recorder has not heard, no replay repeats."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence

from hil.live.daemon import Worker
from hil.nodes.node import Outgoing
from hil.nodes.start_barrier import NOBODY, StartBarrier
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError
from hil.wire.topics import link_topics

_PATIENCE_NS = 1_000_000_000
"""Who is there reports every half second; whoever has not by now is told to be waited for."""


class HeldWorker:
    """Keeps measurements from a worker until all that it ``needs`` have said that they are well.

    Orders go through at any time, and so do ticks: until then nodes say that they wait, and robots stand.
    Who is there once is not waited for again. ``say``: told once what is waited for, if that takes long, and
    that it is over.
    """

    def __init__(
        self, worker: Worker, needs: frozenset[str], links: Sequence[Link], say: Callable[[str], None]
    ) -> None:
        self._worker, self._say = worker, say
        self._barrier, self._present = StartBarrier(needs, links), NOBODY
        self._orders = {topics.STOP, topics.ARM, *(link_topics(link).side for link in links)}
        self._hears = frozenset(worker.subscribes)
        self._is_held, self._is_told, self._tell_ns = True, False, 0
        self.subscribes = tuple(dict.fromkeys((*worker.subscribes, topics.DIAGNOSTICS)))
        self.thorough = worker.thorough

    def begin(self, now_ns: int) -> None:
        """Come up."""
        self._worker.begin(now_ns)
        self._tell_ns = now_ns + _PATIENCE_NS

    def due_ns(self) -> int:
        """When the worker wants to be woken."""
        return self._worker.due_ns()

    def take(self, event: Event, now_ns: int) -> Iterable[Outgoing]:
        """What the worker makes of an arrival that it may have, or of a tick."""
        if self._is_held and event.topic == topics.DIAGNOSTICS:
            with contextlib.suppress(MalformedPayloadError):
                self._present = self._barrier.heard(self._present, event.payload)
            if self._present.well >= self._barrier.needs:
                self._is_held = False
                if self._is_told:
                    self._say(f"all is well with {self._whom()}: begins")
        elif self._is_held and not self._is_told and now_ns >= self._tell_ns:
            self._is_told = True
            self._say(f"uses no measurements before it hears that all is well with {self._whom()}")
        if event.topic and event.topic not in self._hears:
            return ()
        if self._is_held and event.topic and event.topic not in self._orders:
            return ()
        return self._worker.take(event, now_ns)

    def end(self, now_ns: int) -> Iterable[Outgoing]:
        """The worker's last words."""
        return self._worker.end(now_ns)

    def _whom(self) -> str:
        return ", ".join(sorted(self._barrier.needs))
