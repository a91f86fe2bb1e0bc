"""Tracks of many agents as a CSV: one row per sample, coarser where it would grow too large."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.log.written_aside import written_aside

MOST_WRITTEN = 2_000_000
"""Numbers that a file may hold: longer runs of more agents are written more coarsely."""


def write_tracks(
    path: Path,
    t: FloatArray,
    poses: FloatArray,
    v: FloatArray,
    u: FloatArray,
    further: Mapping[str, FloatArray],
) -> None:
    """Write t (n,), per agent x, y, theta, v, u from arrays (n, N, 3) and (n, N), then further columns (n,).

    Agents count from 1. The first and the last sample are always among the rows.
    """
    header, columns = ["t"], [t]
    for agent in range(v.shape[1]):
        header += [f"{name}_{agent + 1}" for name in ("x", "y", "theta", "v", "u")]
        columns += [*poses[:, agent].T, v[:, agent], u[:, agent]]
    header += further.keys()
    columns += further.values()
    table = np.column_stack(columns)[_kept_rows(len(t), len(columns))]
    with written_aside(path) as aside, aside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(table.tolist())


def _kept_rows(rows: int, columns: int) -> NDArray[np.intp]:
    most = max(2, MOST_WRITTEN // columns)
    return np.unique(np.linspace(0, rows - 1, min(rows, most)).round().astype(np.intp))
