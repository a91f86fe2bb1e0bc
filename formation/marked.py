"""The kernels there are, for the compiler to learn, and the plain functions behind what it has compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Marked(NamedTuple):
    """A function that is a kernel; ``inline``: whether compiled code takes it in where it is called."""

    function: Callable[..., Any]
    inline: bool


MARKED: list[Marked] = []
"""All kernels so far, in the order of their definition."""

PLAIN: dict[Callable[..., Any], Callable[..., Any]] = {}
"""The plain Python function behind each compiled entry."""
