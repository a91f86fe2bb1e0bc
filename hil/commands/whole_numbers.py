"""Whole numbers on the command line; what is expected of one is said in words."""

from __future__ import annotations

from typing import Any

import click


class Whole(click.types.IntParamType):
    """A whole number from ``low`` to ``high``, where these are given."""

    name = "number"

    def __init__(self, low: int | None = None, high: int | None = None) -> None:
        self.low, self.high = low, high
        if low is None:
            self.words = ""
        else:
            self.words = f"{low} or more" if high is None else f"{low} to {high}"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number; raises :class:`click.BadParameter` for anything else."""
        try:
            number = int(value)
        except ValueError:
            number = None
        if number is None or not self._in_range(number):
            expected = f"expected a whole number{self.words and f' of {self.words}'}"
            self.fail(f"is {value!r}, {expected}", param, ctx)
        return number

    def _in_range(self, number: int) -> bool:
        return (self.low is None or number >= self.low) and (self.high is None or number <= self.high)
