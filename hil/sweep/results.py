"""The results of a sweep: flown or gone on with, and written as JSON, as a Parquet table and as a report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hil import __version__
from hil.extras import left_out_if_missing
from hil.log.report_json import flat, write_json
from hil.log.written_aside import write_text_aside, written_aside
from hil.sweep.cell_report import report_cell
from hil.sweep.kept_runs import kept_runs
from hil.sweep.spec import Sweep, spec_json
from hil.sweep.work import Store, allowed_distances, pieces_of
from hil.sweep.workers import fly_here, fly_on_cluster

Progress = Callable[[int], None]
"""Called with the number of runs done so far."""


def fly_sweep(
    sweep: Sweep, folder: Path, *, workers: int = 1, scheduler: str | None = None, progress: Progress
) -> dict[str, Any]:
    """JSON of a sweep, after doing what of it is not in the folder yet.

    ``run_seconds`` and ``wall_s`` are of this call. After Ctrl-C it is of what there is: ``interrupted``,
    with ``runs_done``, and without the cells of which there is nothing.
    """
    begun = time.perf_counter()
    store = Store(folder, sweep)
    pieces = list(pieces_of(sweep))
    found = {piece: store.load(piece) for piece in pieces}
    missing = [piece for piece in pieces if found[piece] is None]
    total = sweep.spec.runs * len(sweep.cells())
    done = total - sum(piece.last - piece.first for piece in missing)
    before = done
    progress(done)
    fly = fly_on_cluster(sweep, missing, scheduler) if scheduler else fly_here(sweep, missing, workers)
    interrupted = False
    try:
        for piece, tallies in fly if missing else ():
            store.save(piece, tallies)
            found[piece] = tallies
            done += len(tallies)
            progress(done)
    except KeyboardInterrupt:
        if not done:
            raise
        interrupted = True
    cells, allowed = [], allowed_distances(sweep.scenario)
    for cell in sweep.cells():
        tallied = [found[piece] for piece in pieces if piece.cell == cell]
        if flown := [tallies for tallies in tallied if tallies is not None]:
            cells.append(report_cell(cell, np.concatenate(flown), allowed))
    return {
        "cells": cells,
        "run_seconds": (done - before) * sweep.spec.duration_s,
        "wall_s": time.perf_counter() - begun,
        **({"interrupted": True, "runs_done": done} if interrupted else {}),
    }


def write_results(sweep: Sweep, result: dict[str, Any], folder: Path) -> None:
    """Write ``results.json``, ``results.parquet`` and ``report.html``; cells tell of their ``kept`` runs.

    Those whose extras are missing are left out, and that is said on stderr.
    """
    with left_out_if_missing("results.parquet"):
        write_table(result["cells"], folder / "results.parquet")
    # Numbers of cells are those of the whole sweep.
    if not result.get("interrupted"):
        for cell, kept in zip(result["cells"], kept_runs(sweep, folder), strict=True):
            if kept:
                cell["kept"] = kept
    told = {"version": __version__, "spec": spec_json(sweep.spec), **result}
    write_json(told, folder / "results.json")
    with left_out_if_missing("report.html"):
        from hil.reports.sweep_report import sweep_report

        write_text_aside(folder / "report.html", sweep_report(result))


def write_table(trees: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write one row for each cell, or each of what else; what is nested gets names like ``rmse.v1``."""
    import pyarrow
    from pyarrow import parquet

    rows = [dict(flat(tree)) for tree in trees]
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
    with written_aside(path) as aside:
        parquet.write_table(table, aside)
