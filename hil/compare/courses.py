"""Courses of a run over time as a comparison draws them: shape, errors of the estimate, commands."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.tracking.tracker import Status
from formation.angles import FloatArray, wrap
from hil.compare.group import Group, Sample
from hil.compare.metrics import HEADLINES
from hil.errors import AbreastError
from hil.figures.plot_data import broken_at_jumps
from hil.judge.columns import Columns, columns_of, inside
from hil.judge.dotted_figures import bare
from hil.judge.estimation import errors_at
from hil.judge.run_data import RunData, run_data_of_link, run_data_of_log
from hil.judge.true_states import Stamps
from hil.log.metadata import scenario_of
from hil.log.opened import opened_log
from hil.scenario.links import chain_of, links_of

SHAPES, ERRORS, COMMANDS = ("rho", "alpha1", "alpha2"), ("v1", "alpha1"), ("v2", "u2")


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """One run of a group. Of each kind a time (n,) [s] from when the leader set off, and columns by name.

    ``shape``: true where that is known, else as estimated. ``errors``: empty without truth. ``judged_from``,
    ``last`` [s].
    """

    label: str
    shape: tuple[FloatArray, dict[str, FloatArray]]
    errors: tuple[FloatArray, dict[str, FloatArray]]
    commands: tuple[FloatArray, dict[str, FloatArray]]
    judged_from: float
    last: float


def course_of(group: Group) -> Course | None:
    """That of the run with the median error among those whose log is there; None without any."""
    sample = typical(group)
    if sample is None or sample.log is None:
        return None
    try:
        log = opened_log(sample.log)
        scenario = scenario_of(log)
        if scenario is None:
            return None
        if chain_of(scenario) is None:
            run_data = run_data_of_log(log)
        else:
            run_data = run_data_of_link(log, links_of(scenario)[-1])
    except AbreastError:
        return None
    label = group.label if len(group.samples) == 1 else f"{group.label}: {sample.name}"
    return _course(label, run_data, columns_of(run_data), sample.estimates)


def typical(group: Group) -> Sample | None:
    """The run with the median of the first headline that is known, among those with a log."""
    there = [sample for sample in group.samples if sample.log is not None]
    for headline in HEADLINES:
        known = sorted(
            (value, n)
            for n, sample in enumerate(there)
            for name, value in sample.metrics.items()
            if bare(name) == headline
        )
        if known:
            return there[known[len(known) // 2][1]]
    return there[0] if there else None


def _course(label: str, run_data: RunData, columns: Columns, table: Path | None) -> Course:
    def seconds(moments_ns: Stamps) -> FloatArray:
        return np.asarray((moments_ns - run_data.zero_ns) * 1e-9, dtype=np.float64)

    truth, run, commands = columns.truth, columns.run, columns.commands
    tracked = columns.estimates.only(
        inside(columns.estimates.capture_ns, run) & (columns.estimates.status == Status.TRACKING)
    )
    known = inside(truth.capture_ns, run) & np.isfinite(truth.rho)
    shape = (seconds(truth.capture_ns[known]), {name: getattr(truth, name)[known] for name in SHAPES})
    if not np.any(known):
        shape = (seconds(tracked.capture_ns), {name: getattr(tracked.seen, name) for name in SHAPES})
    for name in ("alpha1", "alpha2"):
        shape[1][name] = broken_at_jumps(shape[1][name])
    during = inside(commands.issued_ns, run)
    found = errors_at(tracked, truth.at(tracked.capture_ns))
    errors = (seconds(tracked.capture_ns), {name: found[name] for name in ERRORS if name in found})
    if table is not None and (read := _errors_of(table, columns)) is not None:
        errors = (seconds(read[0]), read[1])
    return Course(
        label,
        shape,
        errors,
        (seconds(commands.issued_ns[during]), {name: getattr(commands, name)[during] for name in COMMANDS}),
        float(seconds(np.array([columns.span.from_ns]))[0]),
        float(seconds(np.array([run.to_ns]))[0]),
    )


def _errors_of(table: Path, columns: Columns) -> tuple[Stamps, dict[str, FloatArray]] | None:
    """Captures [ns] and errors of a replay's estimates, from the table that it left; None without any."""
    moments, values = [], []
    try:
        with table.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                if row["status"] == Status.TRACKING.name.lower():
                    whole, _, rest = row["t"].partition(".")
                    moments.append(int(whole) * 10**9 + int(rest.ljust(9, "0")))
                    values.append([float(row[name] or math.nan) for name in ERRORS])
    except (OSError, KeyError, ValueError):
        return None
    captures_ns, seen = np.array(moments, dtype=np.int64), np.array(values).reshape(-1, len(ERRORS))
    within = inside(captures_ns, columns.run)
    true = columns.truth.at(captures_ns[within])
    seen = seen[within]
    errors = {"v1": seen[:, 0] - true.v1, "alpha1": wrap(seen[:, 1] - true.alpha1)}
    known = {name: error for name, error in errors.items() if np.any(np.isfinite(error))}
    return captures_ns[within], known
