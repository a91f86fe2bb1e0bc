"""Times on the command line."""

from __future__ import annotations

import math
from typing import Any

import click

_LONGEST = 1e10  # recordings may count from 1970


class Seconds(click.FloatRange):
    """A number of seconds that is one: finite, and of a size that a clock could tell."""

    name = "seconds"

    def __init__(self, low: float = -_LONGEST, *, low_open: bool = False) -> None:
        super().__init__(min=low, max=_LONGEST, min_open=low_open)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; raises :class:`click.BadParameter` for anything else."""
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"{value!r} is not a number of seconds", param, ctx)
        return number


DURATION = Seconds(0.0, low_open=True)
