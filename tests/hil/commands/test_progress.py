"""Progress: redrawn in a terminal, sparse lines elsewhere, and no codes where they are not understood."""

from __future__ import annotations

import io
import os
import pty
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hil.commands import progress as module
from hil.commands.progress import progress


class Clock:
    """A clock that goes when it is told to."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(module, "time", found)
    return found


def test_a_file_gets_a_line_now_and_then_with_the_time_to_go(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("driving", 100.0) as tell:
        for second in range(61):
            clock.now_s = 1000.0 + second
            tell(float(second))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 6
    assert lines[0] == "driving: 10 of 100 s, 90 s to go"
    assert lines[-1] == "driving: 60 of 100 s, 40 s to go"


@contextmanager
def terminal(monkeypatch: pytest.MonkeyPatch, term: str) -> Iterator[io.BytesIO]:
    """A terminal in the place of stderr, and what was written to it."""
    master, slave = pty.openpty()
    seen = io.BytesIO()
    monkeypatch.setenv("TERM", term)
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    with os.fdopen(slave, "w") as file:
        monkeypatch.setattr(sys, "stderr", file)
        yield seen
        file.flush()
        os.set_blocking(master, False)
        try:
            while chunk := os.read(master, 65_536):
                seen.write(chunk)
        except BlockingIOError:
            pass
    os.close(master)


@pytest.mark.parametrize(("term", "codes"), [("xterm", True), ("dumb", False)])
def test_a_terminal_is_drawn_on_if_it_understands_that(
    term: str, codes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_SOON_S", 0.0)
    with terminal(monkeypatch, term) as seen, progress("driving", 4.0) as tell:
        for second in range(5):
            tell(float(second))
    assert (b"\x1b[" in seen.getvalue()) == codes
    assert (b"driving" in seen.getvalue()) == codes


def test_what_was_left_by_an_error_is_not_drawn_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SOON_S", 0.0)
    with terminal(monkeypatch, "xterm") as seen, pytest.raises(ZeroDivisionError), progress("driving", 1.0):
        raise ZeroDivisionError
    # The cursor that a bar hides is there again.
    assert seen.getvalue().count(b"\x1b[?25h") == seen.getvalue().count(b"\x1b[?25l")
