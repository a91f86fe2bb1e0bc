"""What is sent to a browser of numbers and words that anybody may have put on the wire."""

from __future__ import annotations

import math

_LONGEST_TEXT = 300


def shown(number: float) -> float | None:
    """A number to six digits, None for what is no number: JSON knows neither NaN nor infinity.

    >>> shown(0.123456789), shown(float("nan")), shown(float("-inf"))
    (0.123457, None, None)
    """
    return float(f"{number:.6g}") if math.isfinite(number) else None


def deviation(variance: float) -> float | None:
    """Standard deviation, None for what is no variance."""
    return shown(math.sqrt(variance)) if variance >= 0.0 else None


def clipped(text: str) -> str:
    """The beginning of a text that is too long to be shown."""
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}…"
