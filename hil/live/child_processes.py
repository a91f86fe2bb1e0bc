"""The daemons of a live run as child processes: started together, watched closely, ended in order."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from dataclasses import dataclass
from typing import IO

_PATIENCE = 15.0


@dataclass(slots=True)
class Child:
    """One daemon: its process, a descriptor that becomes readable when it ends, and its words in memory."""

    name: str
    process: subprocess.Popen[bytes]
    exit_fd: int
    words: IO[bytes]

    @property
    def failed(self) -> bool:
        """Whether it has ended, which no daemon of a run does before it is told to."""
        return self.process.poll() is not None

    def last_words(self) -> str:
        """The last line that it wrote to its standard error."""
        self.words.seek(0)
        lines = self.words.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""


class Children:
    """The daemons of one run, by name. Each ends by itself when this process goes away."""

    def __init__(self) -> None:
        self._children: dict[str, Child] = {}

    def start(self, name: str, daemon: str, arguments: list[str]) -> None:
        """Start ``abreast DAEMON ARGUMENTS`` in a process group of its own: Ctrl-C is to reach only us."""
        # In memory: a disk that is full is what a daemon may have to tell of.
        words = os.fdopen(os.memfd_create(name), "w+b")
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", daemon, *arguments, "--tethered"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=words,
            start_new_session=True,
        )
        self._children[name] = Child(name, process, os.pidfd_open(process.pid), words)

    def running(self, name: str) -> bool:
        """Whether a daemon has not ended."""
        return not self._children[name].failed

    def wait_for_end_of_any(self, timeout: float) -> Child | None:
        """The first daemon found to have ended, or None after ``timeout`` [s]."""
        readable, _, _ = select.select([child.exit_fd for child in self._children.values()], [], [], timeout)
        return next((child for child in self._children.values() if child.exit_fd in readable), None)

    def end(self, names: list[str]) -> None:
        """Tell daemons to end, together, and wait; one that doesn't is killed."""
        chosen = [self._children[name] for name in names if name in self._children]
        for child in chosen:
            if not child.failed:
                child.process.send_signal(signal.SIGTERM)
        for child in chosen:
            try:
                child.process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                child.process.kill()
                child.process.wait()

    def close(self) -> None:
        """End whatever still runs and let go of files and descriptors."""
        self.end(list(self._children))
        for child in self._children.values():
            os.close(child.exit_fd)
            if child.process.stdin is not None:
                child.process.stdin.close()
            child.words.close()
        self._children.clear()
