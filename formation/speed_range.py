"""The speeds that a leader may drive at."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SpeedRange:
    """Speeds v1 [m/s] that the leader may take, changing as it likes.

    Raises :class:`ValueError` unless 0 < lowest <= highest < infinity.
    """

    lowest: float
    highest: float

    def __post_init__(self) -> None:
        if not 0.0 < self.lowest <= self.highest < math.inf:
            raise ValueError(f"speeds from {self.lowest} to {self.highest}, expected 0 < lowest <= highest")
