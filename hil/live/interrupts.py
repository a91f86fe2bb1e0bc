"""Signals that end a command as Ctrl-C does."""

from __future__ import annotations

import signal
from types import FrameType

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
