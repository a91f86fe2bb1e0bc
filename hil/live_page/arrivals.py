"""When each topic was heard last, and how often it is by the numbers that senders give their messages.

Only some of what comes is looked at, so that it cannot be counted.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TypeVar

from hil.wire.events import NUMBERS, Event, Origin
from hil.wire.message_types import Message
from hil.wire.messages import MalformedPayloadError, decode_as

M = TypeVar("M", bound=Message)

_OVER_S = 2.0


@dataclass(slots=True)
class Arrival:
    """The newest of a topic, when it was seen [s], and the numbers of those of the last moments."""

    event: Event
    at: float
    _numbers: deque[tuple[float, Origin]] = field(default_factory=deque)
    _read: Message | None = None
    _is_read: bool = False

    def renew(self, event: Event, now: float) -> None:
        """One has come."""
        self.event, self.at, self._is_read = event, now, False
        if event.origin is None or (self._numbers and self._numbers[-1][1].sender != event.origin.sender):
            self._numbers.clear()
        if event.origin is not None:
            self._numbers.append((now, event.origin))
        while self._numbers and self._numbers[0][0] < now - _OVER_S:
            self._numbers.popleft()

    def rate_hz(self, now: float) -> float | None:
        """How often it comes; None where the sender does not number what it sends, or several send."""
        if len(self._numbers) < 2 or now - self.at > _OVER_S:
            return None
        (since, first), (until, last) = self._numbers[0], self._numbers[-1]
        return ((last.number - first.number) % NUMBERS) / (until - since) if until > since else None

    def read_as(self, kind: type[M]) -> M | None:
        """The message, read when it is first asked for; None for what is none."""
        if not self._is_read:
            self._is_read = True
            try:
                self._read = decode_as(self.event.payload, kind)
            except MalformedPayloadError:
                self._read = None
        return self._read if isinstance(self._read, kind) else None


class Arrivals:
    """Arrivals by topic."""

    def __init__(self) -> None:
        self._newest: dict[str, Arrival] = {}

    def note(self, event: Event, now: float) -> None:
        """Something came."""
        self._newest.setdefault(event.topic, Arrival(event, now)).renew(event, now)

    def of(self, topic: str) -> Arrival | None:
        """The newest of a topic."""
        return self._newest.get(topic)

    def age_s(self, topic: str, now: float) -> float | None:
        """How long ago a topic was heard last, None if never."""
        arrival = self._newest.get(topic)
        return None if arrival is None else round(max(0.0, now - arrival.at), 3)

    def forget(self) -> None:
        """Nothing was heard any more: nobody has listened since."""
        self._newest.clear()
