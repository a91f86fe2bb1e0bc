"""Whoever a router with keys refuses at its door: Zenoh tells it in its log alone, on standard output."""

from __future__ import annotations

import contextlib
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import zenoh

_TOLD = re.compile(r"zenoh_link_tls\S*: (.*?)(?:\. Hint: .*)?$")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_AGAIN_S = 10.0
"""Between two lines while somebody goes on trying [s]."""

Say = Callable[[str], None]


@dataclass(slots=True)
class RefusedLinks:
    """Refusals that were not said yet, by why."""

    _counts: dict[str, int] = field(default_factory=dict)
    _said_s: float = float("-inf")

    def hear(self, line: str) -> bool:
        """Take a line of Zenoh's log; False for one that tells of no refusal."""
        told = _TOLD.search(_COLOURS.sub("", line.strip()))
        if told is None:
            return False
        self._counts[told[1]] = self._counts.get(told[1], 0) + 1
        return True

    def told(self, now_s: float) -> str:
        """What there is to say at a time [s], empty for nothing: at once, then every so often."""
        if not self._counts or now_s - self._said_s < _AGAIN_S:
            return ""
        self._said_s = now_s
        whys = ", ".join(f"{why} (times: {count})" for why, count in self._counts.items())
        self._counts.clear()
        return f"refused somebody who showed no certificate of this lab: {whys}"


@contextmanager
def refused_links_said(say: Say) -> Iterator[None]:
    """Say that somebody was refused, for as long as the block lasts.

    Standard output is Zenoh's until then; what else it logs goes on to where that went. With ``RUST_LOG`` the
    log is as that says, and nothing is said here.
    """
    zenoh.init_log_from_env_or("zenoh_link_tls=warn")
    if "RUST_LOG" in os.environ:
        yield
        return
    before = os.dup(1)
    reads, writes = os.pipe()
    os.dup2(writes, 1)
    os.close(writes)
    reading = threading.Thread(target=_read, args=(reads, before, say), daemon=True)
    reading.start()
    try:
        yield
    finally:
        # The last of the pipe's other ends.
        os.dup2(before, 1)
        reading.join()
        os.close(before)


def _read(reads: int, before: int, say: Say) -> None:
    refused = RefusedLinks()
    with os.fdopen(reads, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            # Whoever reads us may be gone: the pipe is emptied all the same, else Zenoh would stand still.
            with contextlib.suppress(OSError):
                if not refused.hear(line):
                    os.write(before, line.encode())
                elif text := refused.told(time.monotonic()):
                    say(text)
    if text := refused.told(float("inf")):
        with contextlib.suppress(OSError):
            say(text)
