"""What was written put on the disk each second, in a thread: nobody who takes messages waits for a disk."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from pathlib import Path

PERIOD_S = 1.0
"""What a power cut costs is about this, and the 0.2 s that are still in memory."""


class DiskSync:
    """A thread that syncs a file which grows. ``failure``: what the disk said if it refused, else empty.

    ``sync``: what is called with a descriptor of the file.
    """

    def __init__(self, period_s: float = PERIOD_S, sync: Callable[[int], None] = os.fdatasync) -> None:
        self.failure = ""
        self._period_s, self._sync = period_s, sync
        self._lock = threading.Lock()
        self._held: int | None = None
        self._left: list[int] = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name="disk sync", daemon=True)
        self._thread.start()

    def follow(self, path: Path, descriptor: int) -> None:
        """Sync this file from now on, its folder's entry of it too, and the file before a last time."""
        with contextlib.suppress(OSError):
            # A file of which the folder does not tell is lost by a power cut, however well it was synced.
            folder = os.open(path.parent, os.O_RDONLY)
            with self._lock:
                self._left.append(folder)
        with self._lock:
            if self._held is not None:
                self._left.append(self._held)
            self._held = os.dup(descriptor)

    def close(self) -> None:
        """Sync a last time and end; further calls do nothing."""
        self._ended.set()
        self._thread.join()
        with self._lock:
            if self._held is not None:
                self._left.append(self._held)
                self._held = None
        self._sync_once()

    def _work(self) -> None:
        while not self._ended.wait(self._period_s):
            self._sync_once()

    def _sync_once(self) -> None:
        with self._lock:
            due, self._left = self._left, []
            if self._held is not None:
                due.append(os.dup(self._held))
        for descriptor in due:
            try:
                self._sync(descriptor)
            except OSError as error:
                self.failure = error.strerror or str(error)
            finally:
                os.close(descriptor)
