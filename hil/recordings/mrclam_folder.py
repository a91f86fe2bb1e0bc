"""Reading a folder of the UTIAS multi-robot data sets (MRCLAM): Vicon tracks and odometry as text tables."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.errors import UsageError

_LAST_NS = 2**31 * 1_000_000_000
_TRACK = re.compile(r"Robot(\d+)_Groundtruth\.dat")


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Rows of a file: stamps (n,) that increase [ns], and ``values`` (n, columns)."""

    stamps_ns: NDArray[np.int64]
    values: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Tracks of leader and follower (columns x [m], y [m], theta [rad]) and the follower's odometry.

    Odometry has the columns v [m/s] and u [rad/s]; in these data sets it is what the robot was *told* to
    drive. Sightings, where they are wanted, are what the follower's camera saw of the leader: range [m] and
    bearing [rad]. Robots are named by ``leader``, ``follower``: robot1, robot2, ...
    """

    leader: str
    follower: str
    leader_track: Series
    follower_track: Series
    odometry: Series
    sightings: Series | None = None


def read_pair(folder: Path, leader: int, follower: int, *, sighted: bool = False) -> Pair:
    """Read what there is of two robots.

    Raises :class:`UsageError` for a folder without such files, a robot that it does not have, the same robot
    twice, tracks that have no time in common, and, naming file and line, for a row of the wrong length, a
    cell that isn't a finite number, and times that run backwards.
    """
    if leader == follower:
        raise UsageError(f"--leader {leader} --follower {follower}: expected two different robots")
    there = _robots(folder)
    for option, robot in (("--leader", leader), ("--follower", follower)):
        if robot not in there:
            raise UsageError(
                f"{option} {robot}: folder {folder} has no such robot; there are: "
                f"{', '.join(map(str, there))}"
            )
    leads, follows = (read_series(folder / f"Robot{n}_Groundtruth.dat", 3) for n in (leader, follower))
    odometry = read_series(folder / f"Robot{follower}_Odometry.dat", 2)
    if leads.stamps_ns[0] > follows.stamps_ns[-1] or follows.stamps_ns[0] > leads.stamps_ns[-1]:
        raise UsageError(
            f"folder {folder}: the tracks of robots {leader} and {follower} have no time in common "
            f"({_span(leads)} and {_span(follows)}); use files of one recording"
        )
    seen = _sightings(folder, leader, follower) if sighted else None
    return Pair(f"robot{leader}", f"robot{follower}", leads, follows, odometry, seen)


def read_series(path: Path, columns: int) -> Series:
    """Read a file of rows ``time value value ...``, ``#`` beginning a comment.

    Of several rows with one stamp the last counts. Raises :class:`UsageError` as :func:`read_pair`.
    """
    stamps: list[int] = []
    rows: list[list[float]] = []
    for line, cells in _lines(path):
        if len(cells) != columns + 1:
            raise UsageError(f"{path}: line {line} has {len(cells)} numbers, expected {columns + 1}")
        time, *values = (_number(path, line, cell) for cell in cells)
        stamp_ns = round(time * 1_000_000_000)
        if not 0 <= stamp_ns < _LAST_NS:
            raise UsageError(f"{path}: line {line}: time {time} s, expected 0 or later and before 2038")
        if stamps and stamp_ns < stamps[-1]:
            raise UsageError(f"{path}: line {line}: time {time} s runs backwards; sort the rows by time")
        if stamps and stamp_ns == stamps[-1]:
            stamps.pop()
            rows.pop()
        stamps.append(stamp_ns)
        rows.append([float(value) for value in values])
    if not stamps:
        raise UsageError(f"{path}: has no rows; expected a time and {columns} numbers in each")
    return Series(np.array(stamps, dtype=np.int64), np.array(rows, dtype=np.float64))


def _sightings(folder: Path, leader: int, follower: int) -> Series:
    """What the follower's camera saw of the leader, by the bar code that the leader bears.

    Rows of one stamp are of several subjects, so that the file is read whole and then sifted.
    """
    codes = {round(subject): round(code) for subject, code in _numbers(folder / "Barcodes.dat", 2)}
    if leader not in codes:
        raise UsageError(
            f"{folder / 'Barcodes.dat'}: has no subject {leader}; expected a bar code of robot {leader}"
        )
    path = folder / f"Robot{follower}_Measurement.dat"
    rows = [row for row in _numbers(path, 4) if round(row[1]) == codes[leader]]
    stamps: dict[int, list[float]] = {
        round(time * 1_000_000_000): [float(distance), float(bearing)] for time, _, distance, bearing in rows
    }
    if not stamps:
        raise UsageError(
            f"{path}: robot {follower} never saw robot {leader} (bar code {codes[leader]}); take another pair"
        )
    in_order = sorted(stamps)
    return Series(np.array(in_order, dtype=np.int64), np.array([stamps[at] for at in in_order]))


def _numbers(path: Path, columns: int) -> list[list[Decimal]]:
    """Rows of so many finite numbers."""
    rows: list[list[Decimal]] = []
    for line, cells in _lines(path):
        if len(cells) != columns:
            raise UsageError(f"{path}: line {line} has {len(cells)} numbers, expected {columns}")
        rows.append([_number(path, line, cell) for cell in cells])
    return rows


def _robots(folder: Path) -> list[int]:
    if not folder.is_dir():
        raise UsageError(f"folder {folder}: no such folder; check the path")
    matches = (_TRACK.fullmatch(path.name) for path in folder.iterdir())
    found = sorted(int(match[1]) for match in matches if match)
    if not found:
        raise UsageError(
            f"folder {folder}: no RobotN_Groundtruth.dat in it; give the folder of one unpacked data set"
        )
    return found


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; the folder is not complete") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: is not text; expected rows of numbers") from None
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.partition("#")[0].split()
        if cells:
            yield number, cells


def _number(path: Path, line: int, cell: str) -> Decimal:
    # Decimal, as a float of seconds since 1970 is off by a tenth of a microsecond.
    try:
        number = Decimal(cell.replace("_", "?"))
    except InvalidOperation:
        raise UsageError(f"{path}: line {line}: {cell!r}, expected a number") from None
    if not number.is_finite():
        raise UsageError(f"{path}: line {line}: {cell}, expected a finite number")
    return number


def _span(series: Series) -> str:
    first, last = series.stamps_ns[[0, -1]] * 1e-9
    return f"{first:.3f} to {last:.3f} s"
