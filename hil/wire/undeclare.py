"""Taking back what was declared on a Zenoh session."""

from __future__ import annotations

from typing import Protocol


class Declared(Protocol):
    """A publisher, a subscriber, a queryable or a token."""

    def undeclare(self) -> None:
        """Take it back."""


def undeclare(*declared: Declared) -> None:
    """Take all of it back, in this order."""
    for each in declared:
        each.undeclare()
