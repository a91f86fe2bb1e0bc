"""``python -m hil.faults.shifted_clock SECONDS ARGUMENTS``: a command of abreast where the clock is off."""

from __future__ import annotations

import runpy
import sys
import time


def shift(seconds: float) -> None:
    """Let this process's clock of the day be ahead by so much; the monotonic one goes on as it is."""
    off_ns, whole, fine = round(seconds * 1e9), time.time_ns, time.time
    time.time_ns = lambda: whole() + off_ns
    time.time = lambda: fine() + seconds


if __name__ == "__main__":
    shift(float(sys.argv[1]))
    sys.argv = ["abreast", *sys.argv[2:]]
    runpy.run_module("hil", run_name="__main__")
