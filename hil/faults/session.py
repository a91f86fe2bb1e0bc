"""All chosen faults, one after the other, each as often as is asked for."""

from __future__ import annotations

import itertools
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from hil.errors import AbreastError
from hil.faults.attempt import Try, attempt
from hil.faults.fault import Fault
from hil.faults.link import NotHereError
from hil.faults.report import NEVER_TRIED, Skipped
from hil.faults.tally import Case, is_wrong, worst_of


class Tries(NamedTuple):
    """How many of each fault, and in which ROS domain drivers hear, None for on the wire.

    ``keep``: folder for what was said and written in tries with something wrong, None for nowhere.
    """

    number: int
    ros: int | None = None
    keep: Path | None = None


@dataclass(slots=True)
class Session:
    """What came of faults, what could not be tried and why, and whether it was broken off by Ctrl-C.

    ``broken``: what made the rest impossible, in words. ``ros``: drivers heard in ROS.
    """

    cases: list[Case] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    interrupted: bool = False
    broken: str = ""
    ros: bool = False


def tried(faults: Sequence[Fault], tries: Tries, say: Callable[[str], None]) -> Session:
    """Try faults, and tell of each by ``say``. Ctrl-C leaves what there is by then."""
    session = Session(ros=tries.ros is not None)
    try:
        _try_each(session, faults, tries, say)
    except KeyboardInterrupt:
        session.interrupted = True
    except (AbreastError, OSError) as error:
        session.broken = " ".join(str(error).split())
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
                done.extend(_attempted(fault, folder, tries) for folder in folders)
            except NotHereError as error:
                session.skipped.append(Skipped(fault.name, str(error)))
                say(f"{number}/{len(faults)} {fault.name}: skipped, {error}")
                continue
            finally:
                if done:
                    session.cases.append(Case(fault, len(done), worst_of(done)))
            say(f"{number}/{len(faults)} {_told(session.cases[-1])}, {time.monotonic() - begun_s:.0f} s")


def _attempted(fault: Fault, folder: Path, tries: Tries) -> Try:
    """One try; its folder is gone after it, or kept under a name of its own."""
    try:
        found = attempt(fault, folder, tries.ros)
        if tries.keep is None or not is_wrong(found) or fault.uncovered:
            return found
        places = (tries.keep / f"{fault.name}-{number}" for number in itertools.count(1))
        place = next(place for place in places if not place.exists())
        try:
            shutil.copytree(folder, place)
        except OSError as error:
            # What was found counts all the same.
            return replace(found, wrong=(*found.wrong, f"cannot be kept at {place}: {error}"))
        return replace(found, wrong=(*found.wrong, f"kept at {place}"))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _told(case: Case) -> str:
    worst = case.worst
    wrong = f"; {'; '.join(worst.wrong)}" if worst.wrong else ""
    uncovered = " (not covered)" if case.fault.uncovered else ""
    return f"{case.fault.name}{uncovered}: {worst.runaway_s:.2f} s, {worst.runaway_m:.3f} m{wrong}"
