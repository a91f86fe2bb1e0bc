"""What becomes of a file while it is written: the room that its disk has, and whether it is still there."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from hil.errors import CheckFailedError, UsageError
from hil.log.disk import disk_of, free_bytes

FINDING = "disk"
LEAST_BYTES = 16 << 20
"""Less than this free on the disk ends a run: the end of its log and its results need some."""
SCARCE_BYTES = 64 << 20
"""Less than this is said."""


def refuse_full_disk(folder: Path) -> None:
    """Raise :class:`UsageError` for a folder, which exists, where there is no room to begin a log."""
    if free_bytes(folder) < LEAST_BYTES:
        raise UsageError(
            f"log in {folder}: {disk_of(folder)}; expected {LEAST_BYTES / 1e6:.0f} MB at least: make room or "
            "give another place"
        )


@dataclass(frozen=True, slots=True)
class DiskWatch:
    """Looks after a file, by its path and a descriptor of it."""

    path: Path
    descriptor: int

    def gone(self) -> str:
        """What became of the file, in words, if it is not at its path any more; else empty."""
        mine = os.fstat(self.descriptor)
        try:
            there = os.stat(self.path)
        except OSError:
            there = None
        if there is not None and (there.st_dev, there.st_ino) == (mine.st_dev, mine.st_ino):
            return ""
        if mine.st_nlink:
            return f"log {self.path} was moved away while it is written; it goes on there, no results will"
        return f"log {self.path} was deleted while it is written: what is recorded is lost when the run ends"

    def scarce(self) -> str:
        """That there is little room left, in words; else empty.

        Raises :class:`CheckFailedError` where there is too little to go on.
        """
        found = os.fstatvfs(self.descriptor)
        free = found.f_bavail * found.f_frsize
        if free >= SCARCE_BYTES:
            return ""
        said = f"{disk_of(self.path)}, and the log grows"
        if free < LEAST_BYTES:
            raise CheckFailedError(f"log {self.path}: stopped while it is whole, {said}; make room there")
        return said
