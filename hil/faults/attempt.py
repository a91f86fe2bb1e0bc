"""One try of one fault: its lab, the fault, what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hil.errors import AbreastError
from hil.faults.fault import Fault, Nothing, SecondFollower, Signal
from hil.faults.injection import inject
from hil.faults.judgement import Reason, motion_of
from hil.faults.lab import RUN, Lab, running_lab
from hil.live.process_table import pids_with
from hil.log.reader import read_log
from hil.log.recovery import recover

_SETTLES_S, _AFTER_S, _ENDS_S, _LEAVES_S = 1.0, 1.5, 120.0, 20.0
_BY_US = ("observer", "guard-leader", "guard-follower", "relay", "stranger", "second")
"""Processes of a try that are no part of what is tried."""


@dataclass(frozen=True, slots=True)
class Try:
    """Figures of one try, and in words what is wrong."""

    runaway_s: float = 0.0
    runaway_m: float = 0.0
    oldest_command_s: float = 0.0
    lost_logs: int = 0
    wrong_exit: int = 0
    wrong_reason: int = 0
    hangs: int = 0
    orphans: int = 0
    memory_mb: float = 0.0
    wrong: tuple[str, ...] = ()


def attempt(fault: Fault, folder: Path, ros: int | None = None) -> Try:
    """Try a fault once, with all that is written in a folder that is not there yet.

    ``ros``: a ROS domain in which the drivers hear, None for on the wire.
    Raises :class:`~hil.faults.link.NotHereError` for what this machine does not have.
    """
    with running_lab(folder, fault.setting, ros) as lab:
        if fault.setting.drives and not lab.await_driving():
            said = lab.processes.said()[-300:]
            return Try(hangs=1, memory_mb=lab.processes.memory_mb, wrong=(f"never drove: {said}",))
        if not isinstance(fault.act, Nothing):
            lab.watch(_SETTLES_S)
        reason = inject(lab, fault.act)
        return _what_came(lab, fault, reason)


def _what_came(lab: Lab, fault: Fault, reason: Reason) -> Try:
    """See the end of the try."""
    expected, wrong = fault.expected, list[str]()
    processes = lab.processes
    hangs, code = 0, None
    by_hand = fault.setting.how == "hand"
    if not by_hand:
        lab.watch(fault.setting.duration_s + _ENDS_S, lambda: not lab.is_running())
        code = processes.wait(RUN, 0.1)
        hangs += code is None
    lab.watch(_AFTER_S)
    orphans = 0 if by_hand else _orphans(lab)
    motion = motion_of(lab.look(), expected, reason)
    wrong_exit = 0
    if by_hand:
        for name in [each for each in processes.running if each not in _BY_US]:
            killed = isinstance(fault.act, Signal) and fault.act.role == name
            ended = processes.end(name)
            hangs += ended is None
            if ended is not None and ended not in (expected.codes if killed else (0,)):
                wrong_exit += 1
                wrong.append(f"{name} ended with {ended}")
    elif code is not None and code not in expected.codes:
        wrong_exit = 1
        wrong.append(f"exit code {code}, expected {' or '.join(map(str, expected.codes))}")
    for name in reversed(_BY_US):
        if name in processes.running and not (name == "stranger" or isinstance(fault.act, SecondFollower)):
            processes.end(name)
    said = processes.said()
    reasonless = bool(expected.words) and not any(each in said for each in expected.words)
    if reasonless:
        wrong.append(f"none of {expected.words} in: {said[-400:]}")
    lost = _lost(lab.log)
    if lost:
        wrong.append(lost)
    if hangs or orphans:
        wrong.append(f"{hangs} hang, {orphans} left")
    return Try(
        motion.runaway_s,
        motion.runaway_m,
        motion.oldest_command_s,
        int(bool(lost)),
        wrong_exit,
        int(reasonless),
        hangs,
        orphans,
        processes.memory_mb,
        tuple(wrong),
    )


def _orphans(lab: Lab) -> int:
    """Processes of the run that are left after it has ended, and some time to notice."""
    text = str(lab.folder / "run" / "scenario.toml")
    lab.watch(_LEAVES_S, lambda: not pids_with(text))
    return len(pids_with(text))


def _lost(log: Path) -> str:
    """What is wrong with a log, in words; empty where it can be read, or recovered."""
    if not log.exists():
        return f"{log.name} is not there"
    try:
        read_log(log)
    except AbreastError:
        try:
            recover(log, log.parent.parent / "whole.mcap")
        except AbreastError as error:
            return str(error)
    return ""
