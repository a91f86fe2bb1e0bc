"""What lies in a folder already is not written over unasked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hil.errors import UsageError


def refuse_present(folder: Path, names: Sequence[str]) -> None:
    """Raise :class:`UsageError` for a folder that has one of the files, or folders, to write already."""
    there = [name for name in names if (folder / name).exists()]
    if there:
        raise UsageError(
            f"{folder}: has {there[0]} already; give another folder, or overwrite it (--overwrite)"
        )
