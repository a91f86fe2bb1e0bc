"""Times of a recording as text: seconds, other units, or dates and times of day by ISO 8601."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from typing import NamedTuple

LAST_NS = 2**31 * 1_000_000_000
"""Times are before this: a ROS 2 stamp holds no later one."""

_DATE = re.compile(
    r"(\d{4}-?\d{2}-?\d{2})[T ]+(\d{2}:?\d{2}(?::?\d{2})?)(?:[.,](\d+))?"
    r"\s*(Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)?",
    re.IGNORECASE,
)
_NS = 1_000_000_000


class ReadTimes(NamedTuple):
    """Times [ns], None where a cell is no time, and what they were: ``"seconds"`` or of what dates."""

    t_ns: list[int | None]
    kind: str


def read_times(cells: Sequence[str], scale: Decimal, offset: Decimal, decimal: str = ".") -> ReadTimes:
    """Read cells as times: numbers times ``scale`` plus ``offset`` are seconds, dates are since 1970.

    A date without a zone is taken for UTC. A time before 0 or one after 2038 is none.
    """
    first = next((cell for cell in cells if cell), "")
    date = _DATE.fullmatch(first)
    if date is not None:
        kind = "ISO 8601" if date[4] else "ISO 8601 without a zone, taken for UTC"
        return ReadTimes([_date_ns(cell) for cell in cells], kind)
    comma = decimal != "."
    plain = scale == 1 and offset == 0
    found: list[int | None] = []
    for cell in cells:
        number = _seconds(cell.replace(decimal, ".") if comma else cell)
        if number is not None and not plain:
            number = number * scale + offset
        found.append(_in_range(round(number * _NS)) if number is not None else None)
    return ReadTimes(found, "seconds")


def _seconds(text: str) -> Decimal | None:
    """Decimal, as a float of seconds since 1970 is off by a tenth of a microsecond."""
    try:
        number = Decimal(text)
    except InvalidOperation:
        return None
    # Python takes underscores; and none of these are times.
    if "_" in text or not number.is_finite() or abs(number) > LAST_NS:
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
    return _in_range(seconds * _NS + int((fraction or "0").ljust(9, "0")[:9]))


_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def _in_range(t_ns: int) -> int | None:
    return t_ns if 0 <= t_ns < LAST_NS else None
