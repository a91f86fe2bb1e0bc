"""Times of a recording as text: seconds, other units, or dates and times of day by ISO 8601."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.recordings.pair_log import Times

LAST_NS = 2**31 * 1_000_000_000
"""Times are before this: a ROS 2 stamp holds no later one."""

_DATE = re.compile(
    r"(\d{4}-?\d{2}-?\d{2})[T ]+(\d{2}:?\d{2}(?::?\d{2})?)(?:[.,](\d+))?"
    r"\s*(Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)?",
    re.IGNORECASE,
)
_NS = 1_000_000_000
_MOST_DIGITS = 19
_FINER = (
    ("nanoseconds", 10**17, Decimal("1e-9")),
    ("microseconds", 10**14, Decimal("1e-6")),
    ("milliseconds", 10**11, Decimal("1e-3")),
)


class ReadTimes(NamedTuple):
    """Times (n,) [ns], -1 where a cell is no time, and what they were: seconds, or what kind of dates."""

    t_ns: Times
    kind: str


def read_times(cells: Sequence[str], scale: Decimal, offset: Decimal, decimal: str = ".") -> ReadTimes:
    """Read cells as times: numbers times ``scale`` plus ``offset`` are seconds, dates are since 1970.

    A date without a zone is taken for UTC. Numbers that are told no unit, and are too large for seconds, are
    milliseconds, microseconds or nanoseconds since 1970. A time before 0 or one after 2038 is none.
    """
    first = next((cell for cell in cells if cell), "")
    date = _DATE.fullmatch(first)
    if date is not None:
        kind = "ISO 8601" if date[4] else "ISO 8601 without a zone, taken for UTC"
        return ReadTimes(_in_range([_date_ns(cell) for cell in cells]), kind)
    if decimal != ".":
        cells = [cell.replace(decimal, ".") for cell in cells]
    plain = scale == 1 and offset == 0
    kind = "seconds"
    if plain:
        kind, scale = _since_1970(first if decimal == "." else first.replace(decimal, "."))
        plain = scale == 1
    numbers = [_seconds(cell) for cell in cells]
    if not plain:
        numbers = [None if number is None else number * scale + offset for number in numbers]
    return ReadTimes(_in_range([None if n is None else round(n * _NS) for n in numbers]), kind)


def later(t_ns: Times) -> NDArray[np.bool_]:
    """Whether each time (n,) is one, and later than all before it."""
    before = np.concatenate([[-1], np.maximum.accumulate(t_ns)[:-1]])
    return np.asarray(t_ns > before, dtype=np.bool_)


def _since_1970(first: str) -> tuple[str, Decimal]:
    """What numbers are that are no seconds of our time, by the first, and what makes seconds of them."""
    number = _seconds(first)
    for kind, least, scale in _FINER:
        if number is not None and number > least:
            return f"{kind} since 1970", scale
    return "seconds", Decimal(1)


def _seconds(text: str) -> Decimal | None:
    """Decimal, as a float of seconds since 1970 is off by a tenth of a microsecond."""
    try:
        number = Decimal(text)
    except InvalidOperation:
        return None
    # Python takes underscores; and none of these are times.
    if "_" in text or not number.is_finite() or number.adjusted() > _MOST_DIGITS:
        return None
    return number


def _date_ns(text: str) -> int | None:
    match = _DATE.fullmatch(text)
    if match is None:
        return None
    day, clock, fraction, zone = match.groups()
    named = zone is None or zone.upper() in ("Z", "UTC", "GMT")
    try:
        moment = datetime.fromisoformat(f"{day}T{clock}{'' if named else zone}")
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    seconds = round((moment - _EPOCH).total_seconds())
    return seconds * _NS + int((fraction or "0").ljust(9, "0")[:9])


_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def _in_range(t_ns: Sequence[int | None]) -> Times:
    return np.array([-1 if t is None or not 0 <= t < LAST_NS else t for t in t_ns], dtype=np.int64)
