"""From the tallies of a cell's runs to its part of the results."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.consistency.nees import nees_limits, samples_of_runs
from estimation.tracking.estimate import QUANTITIES
from hil.log.report_json import known
from hil.sweep.spec import Cell
from hil.sweep.tally import BOUNDS


def report_cell(cell: Cell, tallies: NDArray[np.void], allowed: tuple[float, float] | None) -> dict[str, Any]:
    """Figures of a cell, from one tally for each run in the order of the runs.

    ``rmse`` and ``coverage_3sigma`` over all samples of all runs, those of diverged runs too. ``efficiency``:
    RMSE over the root mean square of the posterior Cramer-Rao bound, which is that for random leaders.
    ``nees``: over all samples too; ``nees_limits``: those of deviations that are right, by how the runs,
    which are independent, differ among themselves. ``tightness``: the largest of all runs.
    ``formation.deviation``: RMS off the noise-free run of the same law; ``formation.equilibrium_deviation``:
    off the station, as one law is told from another by. ``formation.certified``: share of moments at which
    the distance was in the certificate's set; absent where it has none. ``worst_run``: the one that came
    nearest to its extended bounds, among those that diverged if there are any. ``law_failed``: runs in which
    a law of one's own failed, absent for none.
    """
    samples = int(tallies["samples"].sum())
    squares, best = _total(tallies["squares"]), _total(tallies["best_sum"])
    best_count, moments = int(tallies["best_count"].sum()), int(tallies["moments"].sum())
    rmse = {name: _root(each, samples) for name, each in zip(QUANTITIES, squares, strict=True)}
    least = {name: _root(each, best_count) for name, each in zip(QUANTITIES, best, strict=True)}
    result: dict[str, Any] = known(
        {
            **cell.point(),
            "runs": len(tallies),
            "samples": samples,
            "untracked": int(tallies["untracked"].sum()),
            "diverged": int(tallies["diverged"].sum()),
            "worst_run": _worst(tallies),
            "law_failed": int(np.count_nonzero(tallies["law_failed"])) or None,
            "rmse": rmse,
            "efficiency": {name: rmse[name] / least[name] for name in rmse if least[name] > 0.0},
            "coverage_3sigma": {
                name: count / samples if samples else None
                for name, count in zip(QUANTITIES, _total(tallies["covered"]), strict=True)
            },
            **_nees(tallies),
            "nis_mean": _mean(tallies["nis_sum"], tallies["nis_count"]),
            "bounds": {
                "violations": dict(zip(BOUNDS, map(int, _total(tallies["violations"])), strict=True)),
                "tightness": dict(zip(BOUNDS, tallies["tightness"].max(axis=0).tolist(), strict=True)),
            },
            "formation": {
                "rho_min": float(tallies["rho_min"].min()),
                "rho_max": float(tallies["rho_max"].max()),
                "deviation": {
                    "rho": _root(sum(tallies["rho_off_sum"].tolist()), moments),
                    "alpha1": _root(sum(tallies["alpha1_off_sum"].tolist()), moments),
                },
                "equilibrium_deviation": {
                    "rho": _root(sum(tallies["rho_station_sum"].tolist()), moments),
                    "alpha1": _root(sum(tallies["alpha1_station_sum"].tolist()), moments),
                },
                "certified": int(tallies["inside"].sum()) / moments if allowed and moments else None,
            },
        }
    )
    return result


def _nees(tallies: NDArray[np.void]) -> dict[str, dict[str, Any]]:
    counts, sums = tallies["nees_count"], tallies["nees_sum"]
    nees, limits = {}, {}
    for k, name in enumerate(QUANTITIES):
        nees[name] = _mean(sums[:, k], counts[:, k])
        judged = counts[:, k] > 0
        limits[name] = nees_limits(samples_of_runs(sums[judged, k] / counts[judged, k]))
    return {"nees": nees, "nees_limits": limits}


def _worst(tallies: NDArray[np.void]) -> int:
    extended = [n for n, name in enumerate(BOUNDS) if name.endswith("_extended")]
    nearest = np.nan_to_num(tallies["tightness"][:, extended].max(axis=1))
    return int(np.lexsort((nearest, tallies["diverged"]))[-1])


def _total(columns: NDArray[Any]) -> list[float]:
    """Sum over the runs, in their order."""
    return [sum(column) for column in columns.T.tolist()]


def _root(total: float, count: int) -> float:
    return math.sqrt(total / count) if count else math.nan


def _mean(totals: NDArray[Any], counts: NDArray[Any]) -> float | None:
    count = int(counts.sum())
    return sum(totals.tolist()) / count if count else None
