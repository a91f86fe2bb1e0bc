"""Laws of one's own that failed in a sweep, and why."""

from __future__ import annotations

from typing import Any

from hil.lockstep.flyer import Flyer
from hil.scenario.brought import law_of
from hil.sweep.spec import Sweep, run_seed


def law_failure(sweep: Sweep, result: dict[str, Any]) -> str:
    """That the sweep's law failed, in how many runs and why; empty if it never did.

    The runs of the first cell in which it did are flown again until it does: its error may be in a worker.
    """
    failed = [cell.get("law_failed", 0) for cell in result["cells"]]
    if not sum(failed):
        return ""
    number = next(number for number, count in enumerate(failed) if count)
    scenario = sweep.scenario_of(sweep.cells()[number])
    law, flyer = law_of(scenario), Flyer(scenario)
    why = ""
    for run in range(sweep.spec.runs):
        flyer.fly(run_seed(sweep.spec.seed, run))
        if why := law.failure() if law is not None else "":
            break
    name = law.name if law is not None else scenario.controller.law
    return f"law {name} failed in {sum(failed)} runs, the robot stood still; first in cell {number}: {why}"
