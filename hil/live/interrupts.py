"""Signals that end a command as Ctrl-C does."""

from __future__ import annotations

import signal
from types import FrameType


def interrupt_on_signals() -> None:
    """Let SIGTERM and SIGHUP raise :class:`KeyboardInterrupt`: else what was started would stay."""

    def leave(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    for number in (signal.SIGTERM, signal.SIGHUP):
        # Who was started with nohup is to outlive its terminal.
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
