"""Whole numbers in what nodes report: anybody may write anything there."""

from __future__ import annotations

_MOST_DIGITS = 19
"""As many as the largest 64-bit number has; Python refuses to read thousands of them."""


def reported_number(text: str) -> int | None:
    """The whole number that a value of a report says, None for anything else.

    >>> reported_number("7"), reported_number("²"), reported_number("-7"), reported_number("7" * 5000)
    (7, None, None, None)
    """
    return int(text) if text.isdecimal() and len(text) <= _MOST_DIGITS else None
