"""How a process steps aside for a run beside it."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

_LOWEST = 19
_AUTOGROUP = Path("/proc/self/autogroup")


def step_aside(niceness: int) -> None:
    """Take the processor less often than the others of this machine do, by ``niceness`` of 0 to 19.

    Where the kernel gives each session its share, a process that leads one shares with others by the
    niceness of the session alone: that is set, too, where we lead one.
    """
    reached = os.nice(niceness)
    if os.getsid(0) == os.getpid():
        # There is none such on other kernels, and one that was set a moment ago may not be set again.
        with contextlib.suppress(OSError):
            _AUTOGROUP.write_text(str(min(reached, _LOWEST)))
