"""How far a command is and how long it takes still, on stderr: redrawn in a terminal, else sparse lines."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Protocol

from hil.log.report_json import note

if TYPE_CHECKING:
    from rich.console import Console

_SOON_S = 1.0
"""What ends sooner needs no progress."""

_DRAWN_EACH_S = 0.1
_LINE_EACH_S = 10.0
_PATIENCE_S = 3.0

READY = "making ready (at first use kernels are compiled)"
"""What is said while modules load."""


class Tell(Protocol):
    """What is called with how much is done, and with how much there is where that was not known before."""

    def __call__(self, done: float, total: float = 0.0) -> None:
        """Tell it."""


def doing(what: str) -> AbstractContextManager[Tell]:
    """Tell that something goes on of which nobody knows how far it is."""
    return progress(what, 0.0, "")


@contextmanager
def progress(what: str, total: float, unit: str = "s") -> Iterator[Tell]:
    """Tell how far something is that ends at ``total``; what it gives is called with how much is done."""
    from rich.console import Console

    console = Console(file=sys.stderr)
    drawn = console.is_terminal and not console.is_dumb_terminal
    shown = _Bar(console, what, total, unit) if drawn else _Lines(what, total, unit)
    waiting = threading.Timer(_SOON_S if drawn else _PATIENCE_S, shown.begin)
    waiting.daemon = True
    waiting.start()
    try:
        yield shown.tell
    finally:
        waiting.cancel()
        shown.end()


class _Lines:
    """Progress where nothing can be drawn anew: a line now and then."""

    def __init__(self, what: str, total: float, unit: str) -> None:
        self._what, self._total, self._unit = what, total, unit
        self._first: tuple[float, float] | None = None
        self._due_s = time.monotonic() + _LINE_EACH_S

    def begin(self) -> None:
        """Say that it takes a while."""
        if self._first is None:
            note(f"{self._what} ...")

    def tell(self, done: float, total: float = 0.0) -> None:
        """Say how far it is, if the last line was long ago."""
        self._total = total or self._total
        now_s = time.monotonic()
        first, first_s = self._first = self._first or (done, now_s)
        if now_s < self._due_s:
            return
        self._due_s = now_s + _LINE_EACH_S
        to_go = ""
        if done > first:
            to_go = f", {(self._total - done) * (now_s - first_s) / (done - first):.0f} s to go"
        note(f"{self._what}: {done:.0f} of {self._total:.0f} {self._unit}{to_go}")

    def end(self) -> None:
        """Nothing: each line is at its end."""


class _Bar:
    """Progress in a terminal, which leaves nothing behind."""

    def __init__(self, console: Console, what: str, total: float, unit: str) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._total, self._unit = total, unit
        self._shown = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[far]}"),
            TimeRemainingColumn() if unit else TimeElapsedColumn(),
            console=console,
            transient=True,
        )
        self._task = self._shown.add_task(what, total=None, far="")
        self._due_s = 0.0

    def begin(self) -> None:
        """Begin to draw."""
        self._shown.start()

    def tell(self, done: float, total: float = 0.0) -> None:
        """Draw how far it is, once in a while."""
        self._total = total or self._total
        if (now_s := time.monotonic()) < self._due_s:
            return
        self._due_s = now_s + _DRAWN_EACH_S
        far = f"{done:.0f} of {self._total:.0f} {self._unit}, to go"
        self._shown.update(self._task, completed=done, total=self._total, far=far)

    def end(self) -> None:
        """Take it away."""
        self._shown.stop()
