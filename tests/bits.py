"""Compare records bit for bit: NaN equals NaN, and -0.0 is not 0.0."""

from __future__ import annotations

import struct
from typing import Any


def bits(value: Any) -> Any:
    """Bits of a number, or of all numbers in nested tuples; NaN has one form."""
    if isinstance(value, tuple):
        return tuple(bits(part) for part in value)
    if isinstance(value, float):
        return "nan" if value != value else struct.pack("<d", value)
    return value


def same_bits(left: Any, right: Any) -> None:
    """Assert that two records, or numbers, are equal to the last bit."""
    assert bits(left) == bits(right), (left, right)
