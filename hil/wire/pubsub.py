"""The wire as a daemon sees it: an inbox of payloads in order of arrival, and a way to publish."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field

import zenoh

from hil.wire.events import TICK, Event
from hil.wire.key_layout import OURS, KeyLayout
from hil.wire.topics import STOP

INBOX_LIMIT = 100_000
"""Payloads kept waiting at most; more than this is dropped and counted, so that memory stays bounded."""


@dataclass(slots=True)
class Inbox:
    """Payloads in order of arrival. ``dropped``: how many found it full."""

    waiting: queue.SimpleQueue[Event] = field(default_factory=queue.SimpleQueue)
    dropped: int = 0

    def put(self, event: Event) -> None:
        """Append an event; called from Zenoh's threads and from signal handlers."""
        if self.waiting.qsize() >= INBOX_LIMIT:
            self.dropped += 1
        else:
            self.waiting.put(event)

    def take(self, timeout: float) -> Event | None:
        """Next event, or None after ``timeout`` [s] without one."""
        try:
            return self.waiting.get(timeout=timeout) if timeout > 0.0 else self.waiting.get_nowait()
        except queue.Empty:
            return None


class Wire:
    """Subscriptions into one inbox, and publishers that are declared when first used.

    ``urgent``: topics that go ahead of all others; ``layout``: the keys of topics.
    """

    def __init__(self, session: zenoh.Session, urgent: Iterable[str] = (), layout: KeyLayout = OURS) -> None:
        self.inbox = Inbox()
        self._session = session
        self._urgent, self._layout = frozenset(urgent), layout
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._subscribers: list[zenoh.Subscriber[None]] = []
        self._lock = threading.Lock()

    def subscribe(self, topics: Iterable[str]) -> None:
        """Let the payloads of the topics into the inbox.

        Zenoh's own thread puts them there, not one for each topic, so that they lie in the order in which
        they came, over all topics. The callback must do nothing else: Zenoh itself would wait for it.
        """
        for topic in topics:

            def keep(sample: zenoh.Sample, topic: str = topic) -> None:
                self.inbox.put(Event(topic, sample.payload.to_bytes()))

            direct = zenoh.handlers.Callback(keep, indirect=False)
            self._subscribers.append(self._session.declare_subscriber(self._layout.key(topic), direct))

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload; urgent topics go ahead of all others.

        A subscriber that cannot follow loses messages rather than holding up everybody else, but for a stop,
        which must arrive.
        """
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._declare(topic)
        publisher.put(payload)

    def wake(self) -> None:
        """Make a waiting :meth:`Inbox.take` return at once."""
        self.inbox.waiting.put(TICK)

    def close(self) -> None:
        """Take back all declarations; needed before the session is closed."""
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]
        for publisher in self._publishers.values():
            publisher.undeclare()  # type: ignore[no-untyped-call]
        self._subscribers.clear()
        self._publishers.clear()

    def _declare(self, topic: str) -> zenoh.Publisher:
        with self._lock:
            if (declared := self._publishers.get(topic)) is not None:
                return declared
            return self._declared(topic)

    def _declared(self, topic: str) -> zenoh.Publisher:
        urgent = topic in self._urgent
        must_arrive = topic == STOP
        congestion = zenoh.CongestionControl.BLOCK if must_arrive else zenoh.CongestionControl.DROP
        publisher = self._session.declare_publisher(
            self._layout.key(topic),
            # Alone in its packet; what many robots are told at once shares one, which halves what it costs.
            express=must_arrive,
            priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA,
            congestion_control=congestion,
        )
        self._publishers[topic] = publisher
        return publisher
