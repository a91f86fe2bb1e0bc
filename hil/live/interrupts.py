"""Signals that end a command as Ctrl-C does."""

from __future__ import annotations

import signal
import time
from types import FrameType, TracebackType
from typing import Any

_LOOKS_S = 1.0
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def interrupt_on_signals(*, once: bool = False) -> None:
    """Let SIGTERM and SIGHUP raise :class:`KeyboardInterrupt` too: else what was started would stay.

    ``once``: after the first of them none is heeded any more. A second one would break off the very thing
    that takes away what was started.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        if once:
            for number in _ENDS:
                signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in _ENDS:
        # Who was started with nohup is to outlive its terminal.
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)


class Interrupt:
    """Signals that ask for the end, noted while somebody looks for one and leaves a verdict then.

    ``number``: of the signal, 0 for none. Where nobody has looked for a second, and on a second one, they
    raise :class:`KeyboardInterrupt`.
    """

    def __init__(self) -> None:
        self.number = 0
        self._looked_s = -_LOOKS_S
        self._before: dict[signal.Signals, Any] = {}

    def go_on(self) -> bool:
        """Whether to go on: nobody has asked for the end."""
        self._looked_s = time.monotonic()
        return not self.number

    def __enter__(self) -> Interrupt:
        for number in _ENDS:
            if signal.getsignal(number) != signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._heard)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()

    def _heard(self, number: int, _frame: FrameType | None) -> None:
        second, self.number = bool(self.number), number
        if second or time.monotonic() - self._looked_s > _LOOKS_S:
            raise KeyboardInterrupt
