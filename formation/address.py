"""Where a function is that was given at run time, and a call of it; see :mod:`formation.first_class`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple


class Address(NamedTuple):
    """Where a function is, and the numbers that are its own; ``function`` 0: there is none."""

    function: int
    numbers: int


NOWHERE = Address(0, 0)
NO_ANSWER = (math.nan, math.nan)

ANSWERS: dict[int, Callable[[Any, int], tuple[float, float]]] = {}
"""How the functions at their addresses answer in plain Python."""


def called(at: Address, asked: Any) -> tuple[float, float]:
    """Answer of the function at an address to a named tuple that holds all that it is asked with.

    Compiled code has this by :mod:`formation.compiled_calls`. Needs an address that is not 0.
    """
    return ANSWERS[at.function](asked, at.numbers)
