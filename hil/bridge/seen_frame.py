"""What a motion capture saw at one moment, whoever it is, and the numbers of its frames."""

from __future__ import annotations

import math
from collections import deque
from typing import Literal, NamedTuple

from hil.wire.records import Placement

Up = Literal["y", "z"]
"""The axis of a motion capture that points up."""

_NO_ORIENTATION = (0.0, 0.0, 0.0, 0.0)
_KEPT = 256
_ANEW = 1000


class SeenBody(NamedTuple):
    """A rigid body: its name, its streaming id as text where it has one, and its pose by the capture's axes.

    ``position`` [m]; ``orientation``: quaternion x, y, z, w. ``tracked``: whether it was seen at that moment.
    """

    name: str
    id: str
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    tracked: bool = True

    @property
    def placed(self) -> bool:
        """Whether it was seen, at a place made of numbers."""
        return self.tracked and all(map(math.isfinite, self.position))

    @property
    def turned(self) -> bool:
        """Whether its orientation is made of numbers; that of a single marker is not."""
        return all(map(math.isfinite, self.orientation))


def place_of(body: SeenBody) -> Placement:
    """The pose of a body; one without an orientation gets zeros for it."""
    return Placement(*body.position, *(body.orientation if body.turned else _NO_ORIENTATION))


class SeenFrame(NamedTuple):
    """A frame: its number, host times [ns] of its capture and its arrival, and all bodies in it."""

    number: int
    capture_ns: int
    arrived_ns: int
    bodies: tuple[SeenBody, ...]


class FrameNumbers:
    """Which frames came, by their numbers. ``missed``, ``late``, ``repeated``: how many so far."""

    def __init__(self) -> None:
        self.came = self.missed = self.late = self.repeated = 0
        self._newest = -1
        self._last: deque[int] = deque(maxlen=_KEPT)

    def hear(self, number: int) -> bool:
        """Take in a number; whether this frame is new. One that is far back begins the count anew."""
        if number in self._last:
            self.repeated += 1
            return False
        ahead = number - self._newest
        if not self._last or not -_ANEW < ahead <= _ANEW:
            self._last.clear()
            self._newest = number
        elif ahead < 0:
            self.late += 1
            self.missed -= 1
        else:
            self.missed += ahead - 1
            self._newest = number
        self.came += 1
        self._last.append(number)
        return True
