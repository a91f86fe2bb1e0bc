"""A robot that keeps its last command for ever, as a TurtleBot3 does; the emulator shares nothing with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

LAG_S = 0.1
"""Time constant of the wheels [s]."""


@dataclass(slots=True)
class Robot:
    """Where a robot is [m, rad], how it moves, what it was told last [m/s, rad/s], and how far it has rolled.

    ``rolled`` counts the way of its middle [m], forward and backward alike.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    v: float = 0.0
    u: float = 0.0
    told_v: float = 0.0
    told_u: float = 0.0
    rolled: float = 0.0

    def tell(self, v: float, u: float) -> None:
        """Take a command; its link carries hundredths."""
        self.told_v, self.told_u = int(100 * v) / 100, int(100 * u) / 100

    def move(self, dt: float) -> None:
        """Go on for ``dt`` [s]: both speeds near what was told as exp(-t / LAG_S) falls."""
        left = math.exp(-dt / LAG_S)
        way = self.told_v * dt + (self.v - self.told_v) * LAG_S * (1.0 - left)
        turn = self.told_u * dt + (self.u - self.told_u) * LAG_S * (1.0 - left)
        self.v = self.told_v + (self.v - self.told_v) * left
        self.u = self.told_u + (self.u - self.told_u) * left
        middle = self.theta + 0.5 * turn
        self.x += way * math.cos(middle)
        self.y += way * math.sin(middle)
        self.theta = math.remainder(self.theta + turn, math.tau)
        self.rolled += abs(way)
