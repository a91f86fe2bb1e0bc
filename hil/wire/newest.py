"""The newest payloads of topics, as Zenoh keeps them for who looks now and then.

Python is not called for each that comes, so that a flood costs whoever looks nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import zenoh

from hil.wire.events import OVERSIZED, Event
from hil.wire.key_layout import KeyLayout
from hil.wire.outlet import origin_of
from hil.wire.pubsub import LARGEST_PAYLOAD_BYTES
from hil.wire.undeclare import undeclare


class Newest:
    """``kept``: by topic, how many of the newest payloads are kept from one look to the next."""

    def __init__(self, session: zenoh.Session, layout: KeyLayout, kept: Mapping[str, int]) -> None:
        self._kept = {
            topic: (count, session.declare_subscriber(layout.heard(topic), zenoh.handlers.RingChannel(count)))
            for topic, count in kept.items()
        }

    def take(self) -> Iterator[Event]:
        """What has come since the last look and is kept, topic by topic, the oldest of each first."""
        for topic, (count, subscriber) in self._kept.items():
            # Counted, as more may come while we look.
            for _ in range(count):
                if (sample := subscriber.try_recv()) is None:
                    break
                sized = len(sample.payload) <= LARGEST_PAYLOAD_BYTES
                yield Event(topic, sample.payload.to_bytes() if sized else OVERSIZED, origin_of(sample))

    def close(self) -> None:
        """End the subscriptions."""
        undeclare(*(subscriber for _, subscriber in self._kept.values()))
        self._kept.clear()
