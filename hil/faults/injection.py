"""How a fault is put into a lab that runs."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time

from hil.faults.fault import (
    Act,
    FullDisk,
    LinkFault,
    Nothing,
    SecondFollower,
    Signal,
    Starvation,
    Stranger,
)
from hil.faults.judgement import Reason
from hil.faults.lab import SCENARIO, START_S, Lab

_BUSY = "while True: pass"
_JOINS_S = 30.0
_TAKES_S = 12.0


def inject(lab: Lab, act: Act) -> Reason:
    """Put a fault into a lab, and come back once it is over, or with what it does under way."""
    match act:
        case Signal(role, number, for_s):
            return _send(lab, role, number, for_s)
        case LinkFault(words, for_s):
            return _hold(lab, words, for_s)
        case Stranger():
            return _let_speak(lab, act)
        case SecondFollower():
            from_s = time.monotonic()
            second = "follower", SCENARIO, "--connect", lab.link.router
            lab.processes.start("second", "-m", "hil", *second)
            lab.watch(_JOINS_S, lambda: not lab.is_running())
            return Reason(from_s)
        case FullDisk():
            from_s = time.monotonic()
            _fill(lab)
            lab.watch(_TAKES_S, lambda: not lab.is_running())
            return Reason(from_s)
        case Starvation(for_s):
            return _starve(lab, for_s)
        case Nothing():
            return _look_on(lab, act)


def _look_on(lab: Lab, act: Nothing) -> Reason:
    from_s = time.monotonic()
    if act.at_s is not None:
        lab.watch(START_S, lambda: bool(_set_off_s(lab)) or not lab.is_running())
        from_s = _set_off_s(lab) + act.at_s
    lab.watch(act.for_s, lambda: not lab.is_running())
    return Reason(from_s, from_s + act.lasts_s if act.at_s is not None else time.monotonic())


def _set_off_s(lab: Lab) -> float:
    """When the leader was first told to drive [s, monotonic], 0 before."""
    taken = lab.look().of("leader").taken
    return next((each.at_s for each in taken if each.drives), 0.0)


def _send(lab: Lab, role: str, number: signal.Signals, for_s: float) -> Reason:
    pid = lab.pid(role)
    from_s = time.monotonic()
    os.kill(pid, number)
    if number != signal.SIGSTOP:
        return Reason(from_s)
    lab.watch(for_s)
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)
    return Reason(from_s, time.monotonic())


def _hold(lab: Lab, words: str, for_s: float) -> Reason:
    from_s = time.monotonic()
    lab.link.become(words)
    lab.watch(for_s)
    until_s = time.monotonic()
    lab.link.become("pass")
    return Reason(from_s, until_s)


def _let_speak(lab: Lab, act: Stranger) -> Reason:
    words = act.kind, lab.link.router, str(act.for_s), str(act.hz)
    speaking = lab.processes.start("stranger", "-m", "hil.faults.stranger", *words)
    assert speaking.stdout is not None
    # It says by the same clock when it begins.
    told = speaking.stdout.readline()
    from_s = float(told) if told.strip() else time.monotonic()
    lab.watch(act.for_s, lambda: speaking.poll() is not None)
    return Reason(from_s, time.monotonic())


def _fill(lab: Lab) -> None:
    with contextlib.suppress(OSError), (lab.folder / "run" / "filler").open("wb", buffering=0) as filler:
        while filler.write(bytes(1 << 16)):
            pass


def _starve(lab: Lab, for_s: float) -> Reason:
    from_s = time.monotonic()
    busy = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        lab.watch(for_s)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    return Reason(from_s, time.monotonic())
