"""Runs of a sweep that are worth a closer look: which ones, and flown once more with a log and a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.sweep.spec import Sweep, run_seed


def keep_run(sweep: Sweep, folder: Path, cell: int, run: int) -> Path:
    """Folder with the log, summary and report of a run, which is flown in lockstep with its seed."""
    from hil.lockstep.run import run_lockstep
    from hil.log.reader import read_log
    from hil.reports.judged_log import judge_log

    kept = folder / f"cell-{cell}-run-{run}"
    if not (kept / "report.html").exists():
        kept.mkdir(exist_ok=True)
        log = kept / "run.mcap"
        log.unlink(missing_ok=True)
        run_lockstep(sweep.scenario_of(sweep.cells()[cell], run_seed(sweep.spec.seed, run)), log)
        judge_log(read_log(log), kept)
    return kept


def kept_runs(sweep: Sweep, folder: Path) -> list[dict[str, str]]:
    """Per cell the names of the folders of its runs that were kept, by the run's number."""
    found: list[dict[str, str]] = [{} for _ in sweep.cells()]
    for summary in folder.glob("cell-*-run-*/summary.json"):
        _, cell, _, run = summary.parent.name.split("-")
        found[int(cell)][run] = summary.parent.name
    return [dict(sorted(each.items(), key=lambda item: int(item[0]))) for each in found]


def worst_runs(result: dict[str, Any]) -> list[tuple[int, int]]:
    """Cell and run that came nearest to the extended bounds, for each estimator."""
    worst: dict[str, tuple[int, float, int]] = {}
    for number, cell in enumerate(result["cells"]):
        tightness = cell["bounds"]["tightness"]
        nearest = max((each for name, each in tightness.items() if name.endswith("_extended")), default=0.0)
        key = cell["diverged"], nearest, number
        worst[cell["estimator"]] = max(worst.get(cell["estimator"], key), key)
    return [(number, result["cells"][number]["worst_run"]) for _, _, number in worst.values()]
