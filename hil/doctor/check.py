"""One thing that was looked at: what was seen, what was expected, and what to do where they differ."""

from __future__ import annotations

from typing import Any, NamedTuple


class Check(NamedTuple):
    """``name``: a word for it. ``advice``: empty where all is well; beside ``ok`` it is a hint only."""

    name: str
    ok: bool
    seen: str
    expected: str
    advice: str = ""

    def as_dict(self) -> dict[str, Any]:
        """It as results have it."""
        return self._asdict()


def check(name: str, ok: bool, seen: str, expected: str, advice: str) -> Check:
    """A check, with the advice only where it failed."""
    return Check(name, ok, seen, expected, "" if ok else advice)
