"""By which frame an order was given: it has to be one of just now, and from after the last stop."""

from __future__ import annotations

import secrets
from collections import deque
from dataclasses import dataclass, field

OLDEST_S = 1.0
"""An order is refused whose frame was sent longer ago [s]."""

_KEPT = 256


@dataclass(slots=True)
class SeenFrames:
    """Numbers of frames, the same for all browsers, and when each was sent.

    An order may wait in a stuck connection while a stop goes by another, and come after it: that a robot may
    be driven again is to be said by somebody who knows of the stop. Not from 0, as a page that was begun
    anew would take numbers of the one before for its own.
    """

    number: int = field(default_factory=lambda: 1 + secrets.randbelow(1 << 40))
    _sent: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    _stopped: int = -1

    def next(self, now: float) -> int:
        """The number of a frame that is sent now."""
        self.number += 1
        self._sent.append((self.number, now))
        return self.number

    def note_stop(self) -> None:
        """A stop was given: who gives another order has to see a frame from after it."""
        self._stopped = self.number

    def refusal(self, number: int, now: float) -> str:
        """Why an order is refused that was given by a frame, empty where it is not."""
        if number <= self._stopped:
            return "not told: a stop was given since; look at the lab, and give the order again"
        sent_at = next((at for each, at in self._sent if each == number), None)
        if sent_at is None or now - sent_at > OLDEST_S:
            return (
                f"not told: the order came late, by a picture of more than {OLDEST_S:g} s ago; "
                "look at the lab, and give the order again"
            )
        return ""
