"""What systemd hears of a daemon that it has started: that it is ready, goes round, and is about to end."""

from __future__ import annotations

import math

from hil.guard.sd_notify import sd_notify

_EACH_S = 0.5
_PATIENCE_S = 10.0


class Service:
    """Tells it where somebody asked for it (``Type=notify``, ``WatchdogSec``); else it does nothing."""

    def __init__(self) -> None:
        self._due_s = math.inf

    def patience_s(self, router: str) -> float:
        """For how long [s] a router, in words, is waited for: a service may begin before it."""
        is_service = sd_notify(f"STATUS=waits for {router}")
        return math.inf if is_service else _PATIENCE_S

    def ready(self, now_s: float) -> None:
        """The daemon takes part, at a time of the monotonic clock [s]."""
        sd_notify("READY=1\nSTATUS=takes part")
        self._due_s = now_s

    def goes_round(self, now_s: float) -> None:
        """Its loop has gone round, of which it tells twice a second once it is ready."""
        if now_s >= self._due_s:
            self._due_s = now_s + _EACH_S
            sd_notify("WATCHDOG=1")

    def ends(self) -> None:
        """It parts from all others now."""
        sd_notify("STOPPING=1")
