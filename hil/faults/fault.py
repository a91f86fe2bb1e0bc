"""What a fault is: the lab that it is put into, what is done, and what is to come of it."""

from __future__ import annotations

import math
import signal
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Since = Literal["fault", "stop"]
"""From when on a robot is to stand: from the fault, or from the stop that whoever noticed it says."""


@dataclass(frozen=True, slots=True)
class Setting:
    """The lab: who runs its daemons, and what lies between it and the follower's guard.

    ``how``: by the supervisor of ``abreast run --real``, each by hand, or ``abreast run`` with its emulated
    robots, whose drivers are only listened to. ``apart``: estimator and controller are two processes.
    ``link``: nothing, a relay of TCP, or a network namespace with a cable of its own. ``disk_mb``: a disk of
    that size for what the run writes, 0 for the usual one. ``clock_s``: how far the clock of the follower's
    daemon is ahead. ``options``: more for the run. ``drives``: the robots are expected to drive before.
    """

    how: Literal["run", "hand", "emulated"] = "run"
    apart: bool = False
    link: Literal["none", "relay", "netns"] = "none"
    disk_mb: int = 0
    clock_s: float = 0.0
    options: tuple[str, ...] = ()
    duration_s: float = 20.0
    drives: bool = True


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal to a process by its role; SIGSTOP is followed by SIGCONT after ``for_s`` [s]."""

    role: str
    number: signal.Signals
    for_s: float = 0.0


@dataclass(frozen=True, slots=True)
class LinkFault:
    """The follower's link is as ``words`` say for a while [s], then as before."""

    words: str
    for_s: float


@dataclass(frozen=True, slots=True)
class Stranger:
    """Somebody of :mod:`hil.faults.stranger` speaks for a while [s], so many times a second."""

    kind: str
    for_s: float
    hz: float


@dataclass(frozen=True, slots=True)
class SecondFollower:
    """Somebody starts another follower's daemon."""


@dataclass(frozen=True, slots=True)
class FullDisk:
    """Somebody fills the run's disk."""


@dataclass(frozen=True, slots=True)
class Starvation:
    """Twice as many busy processes as there are cores, for a while [s]."""

    for_s: float


@dataclass(frozen=True, slots=True)
class Nothing:
    """The fault is in the lab already: look for a while [s].

    It comes ``at_s`` after the leader has set off and lasts for ``lasts_s``; without them it is there
    from the beginning.
    """

    for_s: float
    at_s: float | None = None
    lasts_s: float = math.inf


Act = Signal | LinkFault | Stranger | SecondFollower | FullDisk | Starvation | Nothing


@dataclass(frozen=True, slots=True)
class Expected:
    """What is to come of it.

    ``stands``: from when on each robot is to stand; who is not named may drive on. ``for_good``: to the end,
    else only while the fault lasts. ``codes``: exit codes of the run, or of the process by hand that the
    fault was put into, that are right; ``words``: of these one at least stands in what was said.
    """

    stands: Mapping[str, Since] = field(default_factory=dict)
    for_good: bool = True
    codes: tuple[int, ...] = (1,)
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fault:
    """A case of the matrix. ``uncovered``: why it counts for nothing, empty where it counts."""

    name: str
    role: str
    mode: str
    setting: Setting
    act: Act
    expected: Expected
    uncovered: str = ""
