"""The live page of a run, in a process of its own: whatever becomes of it, the run goes on."""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.live_page.serving import TOKEN_VARIABLE
from hil.wire.session import Endpoints

_LIVE = (sys.executable, "-m", "hil", "live")
_AGAIN_S = 2.0
_PATIENCE_S = 5.0


class PageProcess:
    """``abreast live`` with a socket that listens already, so that it may end and begin again behind it."""

    def __init__(self, listening: socket.socket, token: str, say: Callable[[str], None]) -> None:
        self._listening, self._token, self._say = listening, token, say
        self._process: subprocess.Popen[bytes] | None = None
        self._clock = time.monotonic
        self._begun_s, self._has_failed = -math.inf, False

    def see_to(self, scenario: Path, joining: Endpoints) -> None:
        """Start it, and again if it has ended or could not be started."""
        process, now = self._process, self._clock()
        if (process is not None and process.poll() is None) or now - self._begun_s < _AGAIN_S:
            return
        self._begun_s = now
        if process is not None:
            self._say(f"the live page ended with exit code {process.returncode}; it is started again")
            self._process = None
            if process.stdin is not None:
                process.stdin.close()
        try:
            self._process = self._begun(scenario, joining)
        except OSError as error:
            if not self._has_failed:
                self._say(f"the live page cannot be started: {error.strerror or error}; it is tried again")
            self._has_failed = True
        else:
            self._has_failed = False

    def _begun(self, scenario: Path, joining: Endpoints) -> subprocess.Popen[bytes]:
        number = self._listening.fileno()
        return subprocess.Popen(
            [*_LIVE, str(scenario), *joining.options, "--tethered", "--listening", str(number)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            pass_fds=[number],
            env={**os.environ, TOKEN_VARIABLE: self._token},
            start_new_session=True,
        )

    def close(self) -> None:
        """Let it say good-bye, and end."""
        process = self._process
        if process is None:
            return
        process.terminate()
        try:
            process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdin is not None:
            process.stdin.close()


@contextmanager
def page_process(listening: socket.socket, token: str, say: Callable[[str], None]) -> Iterator[PageProcess]:
    """The page for as long as the block lasts; it begins when it is seen to for the first time."""
    page = PageProcess(listening, token, say)
    try:
        yield page
    finally:
        page.close()
