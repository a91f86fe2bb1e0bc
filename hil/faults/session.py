"""All chosen faults, one after the other, each as often as is asked for."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from hil.faults.attempt import attempt
from hil.faults.fault import Fault
from hil.faults.link import NotHereError
from hil.faults.report import NEVER_TRIED, Skipped
from hil.faults.tally import Case, worst_of


def tried(
    faults: Sequence[Fault], tries: int, say: Callable[[str], None]
) -> tuple[list[Case], list[Skipped]]:
    """Try faults, and tell of each by ``say``: what came of them, and what could not be tried and why."""
    cases, skipped = list[Case](), list[Skipped]()
    with tempfile.TemporaryDirectory(prefix="abreast-faults-") as name:
        for number, fault in enumerate(faults, start=1):
            begun_s = time.monotonic()
            try:
                # By numbers: a fault's own name in a path is not to pass for the word that names it.
                done = [attempt(fault, Path(name) / f"{number}-{turn}") for turn in range(tries)]
            except NotHereError as error:
                skipped.append(Skipped(fault.name, str(error)))
                say(f"{number}/{len(faults)} {fault.name}: skipped, {error}")
                continue
            case = Case(fault, tries, worst_of(done))
            cases.append(case)
            say(f"{number}/{len(faults)} {_told(case)}, {time.monotonic() - begun_s:.0f} s")
    return cases, [*skipped, *NEVER_TRIED]


def _told(case: Case) -> str:
    worst = case.worst
    wrong = f"; {'; '.join(worst.wrong)}" if worst.wrong else ""
    uncovered = " (not covered)" if case.fault.uncovered else ""
    return f"{case.fault.name}{uncovered}: {worst.runaway_s:.2f} s, {worst.runaway_m:.3f} m{wrong}"
