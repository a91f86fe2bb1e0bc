"""What the kernel tells of processes: who runs with what words, and how much memory each takes."""

from __future__ import annotations

import contextlib
from pathlib import Path


def pids_with(text: str) -> dict[int, list[str]]:
    """Command lines of processes in one word of which a text stands, by their numbers."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        with contextlib.suppress(OSError):
            words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
            if any(text in word for word in words):
                found[int(entry.name)] = words
    return found


def memory_mb(pid: int, *, peak: bool = False) -> float:
    """What a process holds in memory now, or held at most [MB]; 0 for one that is gone."""
    name = "VmHWM:" if peak else "VmRSS:"
    with contextlib.suppress(OSError, StopIteration, ValueError):
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
        return float(next(line for line in lines if line.startswith(name)).split()[1]) / 1024.0
    return 0.0
