"""Open-loop programs of the leader: speed and turn rate as functions of time.

The classes check what they are given; compiled code has it as a :class:`Program` and rows, by
:func:`encoded`. Both drive by the same kernels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple, Protocol, cast

from formation.kernel import kernel
from formation.pose import Motion
from formation.records import Rows, load, rows_of, size, store


class ProgramKind(IntEnum):
    """Kinds of program."""

    CONSTANT = 0
    SINUSOID = 1
    IMPULSE = 2
    TABLE = 3


_CONSTANT, _SINUSOID, _IMPULSE = (
    ProgramKind.CONSTANT.value,
    ProgramKind.SINUSOID.value,
    ProgramKind.IMPULSE.value,
)


class Program(NamedTuple):
    """A program by a value of :class:`ProgramKind` and its numbers, zero where it has fewer.

    v, u of :class:`Constant`; v, u_mean, u_amplitude, omega of :class:`Sinusoid`; v, u_amplitude, t_centre,
    t_width of :class:`Impulse`; none of :class:`Table`, which has rows.
    """

    kind: int
    p0: float
    p1: float
    p2: float
    p3: float


class TableRow(NamedTuple):
    """Speed v [m/s] and turn rate u [rad/s] at time t [s]."""

    t: float
    v: float
    u: float


@kernel
def driven(program: Program, table: Rows[TableRow], t: float) -> Motion:
    """What a program drives at time t [s]; ``table``: its rows, at least one if it is a table."""
    if program.kind == _SINUSOID:
        return _waved(program.p0, program.p1, program.p2, program.p3, t)
    if program.kind == _IMPULSE:
        return _swerved(program.p0, program.p1, program.p2, program.p3, t)
    if program.kind == _CONSTANT:
        return Motion(program.p0, program.p1)
    return _interpolated(table, t)


@kernel
def _waved(v: float, u_mean: float, u_amplitude: float, omega: float, t: float) -> Motion:
    return Motion(v, u_mean + u_amplitude * math.sin(omega * t))


@kernel
def _swerved(v: float, u_amplitude: float, t_centre: float, t_width: float, t: float) -> Motion:
    widths = (t - t_centre) / t_width
    return Motion(v, u_amplitude * math.exp(-0.5 * widths * widths))


@kernel
def _interpolated(table: Rows[TableRow], t: float) -> Motion:
    """Linear between rows, held outside."""
    low, after = 0, size(table)
    while low < after:
        middle = (low + after) // 2
        if load(TableRow, table, middle).t <= t:
            low = middle + 1
        else:
            after = middle
    last = load(TableRow, table, min(after, size(table) - 1))
    if after == 0 or after == size(table):
        return Motion(last.v, last.u)
    first = load(TableRow, table, after - 1)
    share = (t - first.t) / (last.t - first.t)
    return Motion((1.0 - share) * first.v + share * last.v, (1.0 - share) * first.u + share * last.u)


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
        return _waved(self.v, self.u_mean, self.u_amplitude, self.omega, t)

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
        return _swerved(self.v, self.u_amplitude, self.t_centre, self.t_width, t)

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
    _rows: list[TableRow] = field(init=False, repr=False, compare=False)

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
        object.__setattr__(self, "_rows", list(map(TableRow, self.t, self.v, self.u)))

    def __call__(self, t: float) -> Motion:
        """Motion at time t, interpolated."""
        return _interpolated(cast("Rows[TableRow]", self._rows), t)

    @property
    def period(self) -> float | None:
        """None: a table is not repeated."""
        return None

    @property
    def longest_step(self) -> float:
        """Shortest interval of the table; no limit for a table of one row."""
        return min((b - a for a, b in zip(self.t, self.t[1:], strict=False)), default=math.inf)


def encoded(program: LeaderProgram) -> tuple[Program, Rows[TableRow]]:
    """A program as compiled code takes it, and the rows of its table, none for another kind.

    Raises :class:`ValueError` for a class that is none of this module's.
    """
    nothing = rows_of(TableRow, 0)
    match program:
        case Constant(v, u):
            return Program(ProgramKind.CONSTANT.value, v, u, 0.0, 0.0), nothing
        case Sinusoid(v, u_mean, u_amplitude, omega):
            return Program(ProgramKind.SINUSOID.value, v, u_mean, u_amplitude, omega), nothing
        case Impulse(v, u_amplitude, t_centre, t_width):
            return Program(ProgramKind.IMPULSE.value, v, u_amplitude, t_centre, t_width), nothing
        case Table(t, v, u):
            rows = rows_of(TableRow, len(t))
            for k, row in enumerate(zip(t, v, u, strict=True)):
                store(rows, k, TableRow(*row))
            return Program(ProgramKind.TABLE.value, 0.0, 0.0, 0.0, 0.0), rows
    raise ValueError(f"{type(program).__name__} is no kind of program that compiled code can be given")
