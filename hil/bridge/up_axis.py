"""Which axis of a motion capture points up, as far as tracks tell it."""

from __future__ import annotations

from typing import Literal, NamedTuple

Up = Literal["y", "z"]
Vector = tuple[float, float, float]

_TRAVEL = 0.3
_CLIMB = 0.1
_FLAT = 0.03


class Extent(NamedTuple):
    """The box that a track has filled so far."""

    low: Vector
    high: Vector

    def with_point(self, point: Vector) -> Extent:
        """The box with one point more."""
        low = tuple(map(min, self.low, point))
        high = tuple(map(max, self.high, point))
        return Extent((low[0], low[1], low[2]), (high[0], high[1], high[2]))

    @property
    def sides(self) -> Vector:
        """Lengths of its sides [m]."""
        x, y, z = (high - low for low, high in zip(self.low, self.high, strict=True))
        return x, y, z


class HeightCheck:
    """Whether robots, which do not climb, do so by the axis that is said to point up.

    ``wrong``: what was seen, in words, as long as the last track that told anything says so; else empty.
    """

    def __init__(self, up: Up) -> None:
        self.wrong = ""
        self._up: Up = up
        self._extents: dict[str, Extent] = {}

    def see(self, name: str, position: Vector) -> None:
        """Take in where a body is, by the capture's own axes."""
        before = self._extents.get(name, Extent(position, position))
        extent = before.with_point(position)
        if max(extent.sides) < _TRAVEL:
            self._extents[name] = extent
            return
        self._extents[name] = Extent(position, position)
        self._judge(name, extent)

    def _judge(self, name: str, extent: Extent) -> None:
        _, along_y, along_z = extent.sides
        rises, stays = (along_y, along_z) if self._up == "y" else (along_z, along_y)
        other = "z" if self._up == "y" else "y"
        if rises > _CLIMB and stays < _FLAT:
            self.wrong = (
                f"{name} climbs {rises:.2f} m along {self._up}, which is to point up, "
                f"and stays within {stays:.3f} m along {other}"
            )
        elif rises < _FLAT and stays > _CLIMB:
            self.wrong = ""
