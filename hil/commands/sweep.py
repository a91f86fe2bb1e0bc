"""``abreast sweep``: Monte Carlo over noise against the bounds, on this machine or a cluster."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import click

from hil.commands.outputs import OutputFolder, new_folder
from hil.commands.own_parts import load_own_parts
from hil.commands.progress import READY, doing, progress
from hil.commands.seconds import Seconds
from hil.commands.whole_numbers import Whole
from hil.errors import CheckFailedError, InterruptedRunError, UsageError
from hil.extras import begin_to_judge
from hil.log.report_json import print_json, results_apart, say
from hil.reports.judged_log import results_in
from hil.sweep.spec import Sweep, load_sweep


@click.command("sweep")
@click.argument("spec", default="default")
@click.option("--runs", type=Whole(1), metavar="N", help="Runs of every cell.")
@click.option("--seed", type=Whole(0), metavar="N", help="Seed of all noise.")
@click.option("--duration", type=Seconds(1.0), metavar="S", help="Seconds of every run.")
@click.option(
    "--estimators", metavar="A,B", help="Estimators, any that a scenario takes, file.py:factory too."
)
@click.option("--law", metavar="L", help="Law of the follower, file.py:function too, in all cells.")
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key in all cells."
)
@click.option(
    "--grid", "axes", multiple=True, metavar="AXIS=A,B,...", help="Values of an axis in place of SPEC's."
)
@click.option("--workers", type=Whole(1), metavar="N", help="Processes [as many as there are processors].")
@click.option(
    "--scheduler", metavar="ADDRESS", help="Dask scheduler to send the work to, like tcp://host:8786."
)
@click.option(
    "--keep",
    "kept",
    multiple=True,
    metavar="CELL:RUN",
    help="Also write this run as a full log with its report; 'worst': that of each estimator.",
)
@click.option("--out", type=OutputFolder(), metavar="DIR", help="Folder for results.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as one JSON object on stdout.")
@results_apart()
def command(
    spec: str,
    runs: int | None,
    seed: int | None,
    duration: float | None,
    estimators: str | None,
    law: str | None,
    overrides: tuple[str, ...],
    axes: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    kept: tuple[str, ...],
    out: Path | None,
    as_json: bool,
) -> None:
    """Fly many runs of every cell of SPEC (a shipped name or a TOML file), and judge them.

    Given the same --out again, a sweep that was interrupted goes on. Cells and runs count from 0.
    """
    begin_to_judge("sweep")
    with doing(READY):
        from hil.sweep.failed_laws import law_failure
        from hil.sweep.kept_runs import keep_run, worst_runs
        from hil.sweep.results import write_results

    names = None if estimators is None else [name.strip() for name in estimators.split(",")]
    if law is not None:
        overrides = (*overrides, f"controller.law={law}")
    sweep = load_sweep(spec, overrides, axes, runs=runs, seed=seed, duration_s=duration, estimators=names)
    for point in sweep.cells()[: len(sweep.spec.estimators)]:
        load_own_parts(sweep.scenario_of(point))
    to_keep = [_parsed(sweep, text) for text in kept if text != "worst"]
    folder = out or new_folder("sweep")
    result = _fly(sweep, folder, workers or len(os.sched_getaffinity(0)), scheduler)
    if "worst" in kept:
        to_keep += worst_runs(result)
    if not result.get("interrupted"):
        for cell, run in to_keep:
            say(f"kept {keep_run(sweep, folder, cell, run)}")
    write_results(sweep, result, folder)
    say(results_in(folder))
    if as_json:
        print_json(result)
    if result.get("interrupted"):
        raise InterruptedRunError(
            f"interrupted after {result['runs_done']} of {sweep.spec.runs * len(sweep.cells())} runs; "
            f"the same again with --out {folder} goes on",
            signal.SIGINT,
        )
    if reason := law_failure(sweep, result):
        raise CheckFailedError(reason)


def _parsed(sweep: Sweep, text: str) -> tuple[int, int]:
    cell, colon, run = text.partition(":")
    cells, runs = len(sweep.cells()), sweep.spec.runs
    if not (colon and cell.isdecimal() and run.isdecimal() and int(cell) < cells and int(run) < runs):
        raise UsageError(
            f"--keep {text!r}: expected CELL:RUN with a cell of 0 to {cells - 1} and a run of 0 to {runs - 1}"
        )
    return int(cell), int(run)


def _fly(sweep: Sweep, folder: Path, workers: int, scheduler: str | None) -> dict[str, Any]:
    from hil.sweep.results import fly_sweep

    with progress("flying", sweep.spec.runs * len(sweep.cells()), "runs") as tell:
        result = fly_sweep(sweep, folder, workers=workers, scheduler=scheduler, progress=tell)
    _say(result)
    return result


def _say(result: dict[str, Any]) -> None:
    from hil.judge.consistency import nees_finding
    from hil.reports.sweep_verdict import sweep_verdict

    cells = result["cells"]
    speed = result["run_seconds"] / result["wall_s"]
    for line in sweep_verdict(result).lines():
        say(line)
    if off := sum(bool(nees_finding(cell)) for cell in cells):
        say(f"in {off} of {len(cells)} cells the deviations are not what the errors are (nees)")
    say(f"{result['run_seconds']:.0f} s of runs in {result['wall_s']:.1f} s ({speed:.0f} to 1)")
