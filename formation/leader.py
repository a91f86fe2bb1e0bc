"""Open-loop programs of the leader: speed and turn rate as functions of time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from formation.pose import Motion


class LeaderProgram(Protocol):
    """What the leader drives at time t [s], defined for all t."""

    def __call__(self, t: float) -> Motion:
        """Speed and turn rate at time t."""
        ...

    @property
    def period(self) -> float | None:
        """Least period [s], or None for a program that has none (a constant one included)."""
        ...

    @property
    def longest_step(self) -> float:
        """Longest step [s] that an integrator may take without stepping over a feature of the program."""
        ...


@dataclass(frozen=True, slots=True)
class Constant:
    """Constant speed v and turn rate u: a line or a circle."""

    v: float
    u: float = 0.0

    def __call__(self, t: float) -> Motion:
        """Motion at time t, the same at every t."""
        return Motion(self.v, self.u)

    @property
    def period(self) -> float | None:
        """None: a constant has no least period."""
        return None

    @property
    def longest_step(self) -> float:
        """No limit."""
        return math.inf


@dataclass(frozen=True, slots=True)
class Sinusoid:
    """Constant speed v, turn rate u_mean + u_amplitude * sin(omega * t); omega > 0 [rad/s]."""

    v: float
    u_mean: float
    u_amplitude: float
    omega: float

    def __post_init__(self) -> None:
        if not (self.omega > 0.0 and math.isfinite(self.omega)):
            raise ValueError(f"omega is {self.omega}, expected a positive finite number")

    def __call__(self, t: float) -> Motion:
        """Motion at time t."""
        return Motion(self.v, self.u_mean + self.u_amplitude * math.sin(self.omega * t))

    @property
    def period(self) -> float | None:
        """2 pi / omega."""
        return 2.0 * math.pi / self.omega

    @property
    def longest_step(self) -> float:
        """An eighth of a period."""
        return 0.25 * math.pi / self.omega


@dataclass(frozen=True, slots=True)
class Impulse:
    """Constant speed v, turn rate a Gaussian bell of height u_amplitude about t_centre, deviation t_width."""

    v: float
    u_amplitude: float
    t_centre: float
    t_width: float

    def __post_init__(self) -> None:
        if not (self.t_width > 0.0 and math.isfinite(self.t_width)):
            raise ValueError(f"t_width is {self.t_width}, expected a positive finite number")

    def __call__(self, t: float) -> Motion:
        """Motion at time t."""
        widths = (t - self.t_centre) / self.t_width
        return Motion(self.v, self.u_amplitude * math.exp(-0.5 * widths * widths))

    @property
    def period(self) -> float | None:
        """None: it happens once."""
        return None

    @property
    def longest_step(self) -> float:
        """Half the bell's deviation."""
        return 0.5 * self.t_width


@dataclass(frozen=True, slots=True)
class Table:
    """Speeds v and turn rates u at times t, linear in between, held before the first and after the last.

    Takes any sequences and keeps tuples. Raises :class:`ValueError` if they are empty or of unequal length,
    hold anything that is not finite, or if the times do not increase strictly.
    """

    t: Sequence[float]
    v: Sequence[float]
    u: Sequence[float]

    def __post_init__(self) -> None:
        columns = {name: tuple(map(float, getattr(self, name))) for name in ("t", "v", "u")}
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) != 1 or not columns["t"]:
            raise ValueError(f"table has columns of lengths {lengths}, expected equal lengths of at least 1")
        for name, column in columns.items():
            for row, value in enumerate(column):
                if not math.isfinite(value):
                    raise ValueError(f"table has {name}[{row}] = {value}, expected a finite number")
            object.__setattr__(self, name, column)
        for row in range(1, len(self.t)):
            if self.t[row] <= self.t[row - 1]:
                raise ValueError(
                    f"table has t[{row}] = {self.t[row]} after {self.t[row - 1]}, expected increasing times"
                )

    def __call__(self, t: float) -> Motion:
        """Motion at time t, interpolated."""
        after = bisect_right(self.t, t)
        if after == 0:
            return Motion(self.v[0], self.u[0])
        before = after - 1
        if after == len(self.t):
            return Motion(self.v[before], self.u[before])
        share = (t - self.t[before]) / (self.t[after] - self.t[before])
        return Motion(
            (1.0 - share) * self.v[before] + share * self.v[after],
            (1.0 - share) * self.u[before] + share * self.u[after],
        )

    @property
    def period(self) -> float | None:
        """None: a table is not repeated."""
        return None

    @property
    def longest_step(self) -> float:
        """Shortest interval of the table; no limit for a table of one row."""
        return min((b - a for a, b in zip(self.t, self.t[1:], strict=False)), default=math.inf)
