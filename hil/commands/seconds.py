"""Times on the command line; what is expected of one is said in words."""

from __future__ import annotations

import math
from typing import Any

import click

_LONGEST = 1e10  # recordings may count from 1970


class Seconds(click.types.FloatParamType):
    """A number of seconds that is one: finite, and of a size that a clock could tell."""

    name = "seconds"

    def __init__(self, low: float = -_LONGEST, *, low_open: bool = False) -> None:
        self.low, self.low_open = low, low_open
        self.words = ""
        if low > -_LONGEST:
            self.words = f"more than {low:g}" if low_open else f"{low:g} or more"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; raises :class:`click.BadParameter` for anything else."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        above = number > self.low if self.low_open else number >= self.low
        if not (above and number <= _LONGEST):
            expected = f"expected a number of seconds{self.words and f', {self.words}'}"
            self.fail(f"is {value!r}, {expected}", param, ctx)
        return number


DURATION = Seconds(0.0, low_open=True)
