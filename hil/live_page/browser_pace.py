"""How fast one browser is sent frames: as fast as it says that it has seen them, so that none pile up."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

_MOST_UNSEEN = 3
_PATIENCE_S = 10.0


@dataclass(slots=True)
class BrowserPace:
    """Frames on their way to a browser. A slow one is sent fewer; what it is not sent is gone.

    ``link_s``: from when a frame was sent to when we heard that it was seen [s], the last time.
    """

    link_s: float = 0.0
    _unseen: deque[tuple[int, float]] = field(default_factory=deque)

    def may_send(self) -> bool:
        """Whether it has seen enough of what it was sent."""
        return len(self._unseen) < _MOST_UNSEEN

    def send(self, number: int, now: float) -> None:
        """A frame is sent now, of a higher number than all before."""
        self._unseen.append((number, now))

    def see(self, number: int, now: float) -> None:
        """It says that it has seen a frame, and so all before it."""
        while self._unseen and self._unseen[0][0] <= number:
            _, sent_at = self._unseen.popleft()
            self.link_s = now - sent_at

    def is_gone(self, now: float) -> bool:
        """Whether it has seen nothing for so long that nobody can be there."""
        return bool(self._unseen) and now - self._unseen[0][1] > _PATIENCE_S
