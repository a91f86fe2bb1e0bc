"""The disk that a file lies on: what it is called, how much room it has, and what to say when it is full."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from hil.errors import AbreastError

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Error numbers by which a disk refuses to take more."""


def free_bytes(path: Path) -> int:
    """Bytes that the disk of a file or folder, which exists, has free for us."""
    found = os.statvfs(path)
    return found.f_bavail * found.f_frsize


def disk_of(path: Path) -> str:
    """The disk of a file or folder in words: where it is mounted and what is free on it."""
    there = path.resolve()
    while not there.exists():
        there = there.parent
    mount = there
    while not mount.is_mount():
        mount = mount.parent
    return f"disk {mount} ({free_bytes(there) / 1e6:.1f} MB free)"


def no_room(path: Path, error: OSError) -> AbreastError:
    """The error for a file that its disk has no room for."""
    reason = error.strerror or str(error)
    return AbreastError(f"{path}: writing failed ({reason}) on {disk_of(path)}; make room there")
