"""All chosen faults, one after the other, each as often as is asked for."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from hil.faults.attempt import Try, attempt
from hil.faults.fault import Fault
from hil.faults.link import NotHereError
from hil.faults.report import NEVER_TRIED, Skipped
from hil.faults.tally import Case, worst_of


class Tries(NamedTuple):
    """How many of each fault, and in which ROS domain drivers hear, None for on the wire."""

    number: int
    ros: int | None


@dataclass(slots=True)
class Session:
    """What came of faults, what could not be tried and why, and whether it was broken off by Ctrl-C.

    ``ros``: drivers heard in ROS.
    """

    cases: list[Case] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    interrupted: bool = False
    ros: bool = False


def tried(faults: Sequence[Fault], tries: int, say: Callable[[str], None], ros: int | None = None) -> Session:
    """Try faults, and tell of each by ``say``. Ctrl-C leaves what there is by then.

    ``ros``: a ROS domain in which the drivers hear, None for on the wire.
    """
    session = Session(ros=ros is not None)
    try:
        _try_each(session, faults, Tries(tries, ros), say)
    except KeyboardInterrupt:
        session.interrupted = True
    session.skipped += NEVER_TRIED
    return session


def _try_each(session: Session, faults: Sequence[Fault], tries: Tries, say: Callable[[str], None]) -> None:
    with tempfile.TemporaryDirectory(prefix="abreast-faults-") as name:
        for number, fault in enumerate(faults, start=1):
            begun_s = time.monotonic()
            done: list[Try] = []
            try:
                # By numbers: a fault's own name in a path is not to pass for the word that names it.
                folders = [Path(name) / f"{number}-{turn}" for turn in range(tries.number)]
                done.extend(attempt(fault, folder, tries.ros) for folder in folders)
            except NotHereError as error:
                session.skipped.append(Skipped(fault.name, str(error)))
                say(f"{number}/{len(faults)} {fault.name}: skipped, {error}")
                continue
            finally:
                if done:
                    session.cases.append(Case(fault, len(done), worst_of(done)))
            say(f"{number}/{len(faults)} {_told(session.cases[-1])}, {time.monotonic() - begun_s:.0f} s")


def _told(case: Case) -> str:
    worst = case.worst
    wrong = f"; {'; '.join(worst.wrong)}" if worst.wrong else ""
    uncovered = " (not covered)" if case.fault.uncovered else ""
    return f"{case.fault.name}{uncovered}: {worst.runaway_s:.2f} s, {worst.runaway_m:.3f} m{wrong}"
