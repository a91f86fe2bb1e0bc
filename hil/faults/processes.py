"""Processes of a try: started by name, watched, and ended."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from hil.live.process_table import memory_mb, pids_with

_PATIENCE_S = 20.0


class Processes:
    """Processes by name, in order of their start. ``NAME.err`` in a folder takes what each prints."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self.memory_mb = 0.0

    def start(self, name: str, *arguments: str, before: Sequence[str] = ()) -> subprocess.Popen[bytes]:
        """Start ``python ARGUMENTS``; ``before``: what goes before it on the command line."""
        with self._words(name).open("wb") as words:
            process = subprocess.Popen(
                [*before, sys.executable, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE if name == "stranger" else words,
                stderr=words,
                start_new_session=True,
            )
        self.running[name] = process
        return process

    def said(self) -> str:
        """All that all have said, on one line."""
        texts = [self._words(name).read_text(encoding="utf-8", errors="replace") for name in self.running]
        return " ".join(" ".join(texts).split())

    def end(self, name: str) -> int | None:
        """End one by SIGTERM, and its exit code, None for one that had to be killed."""
        process = self.running[name]
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGTERM)
        return self.wait(name, _PATIENCE_S)

    def wait(self, name: str, patience_s: float) -> int | None:
        """Wait for the end of one, and its exit code, None for one that had to be killed."""
        process, until_s = self.running[name], time.monotonic() + patience_s
        while process.poll() is None and time.monotonic() < until_s:
            self.look()
            time.sleep(0.05)
        if process.poll() is not None:
            return process.returncode
        process.kill()
        process.wait()
        return None

    def look(self) -> None:
        """Note how much memory the largest process of the try has taken."""
        for pid in pids_with(str(self._folder)):
            self.memory_mb = max(self.memory_mb, memory_mb(pid, peak=True))

    def close(self) -> None:
        """Kill whatever still runs, what was started by others among it: a frozen daemon outlives its run."""
        for process in self.running.values():
            if process.poll() is None:
                process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
        for pid in pids_with(str(self._folder)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _words(self, name: str) -> Path:
        return self._folder / f"{name}.err"
