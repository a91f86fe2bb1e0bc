"""The aligned table of a follower: a row for each estimate, with all that was known and true at its time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import cast

import numpy as np

from estimation.bounds.error_bounds import Perceived
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray, wrap
from hil.exports.aligned_columns import ALIGNED_COLUMNS, SHAPE, TRUE_POSES
from hil.exports.logged_run import DIAGONAL, LoggedRun, Refusals, Table
from hil.judge.columns import EstimateColumns, judged_rows
from hil.judge.estimation import errors_at
from hil.judge.sound_messages import can_be_rows
from hil.judge.true_states import Stamps, TrueStates
from hil.log.cdr_columns import Array, Values

_ROWS = 1 << 14
_S = 1e-9
_OWN = ("v2", "u2")
_BOUNDS = ("bound_v1", "bound_alpha1", "bound_h")
_RADII = ("radius_v1", "radius_alpha1")
_COMMANDED = ("v2", "u2", "v2_wanted", "u2_wanted")
_STATUSES = np.array([status.name.lower() for status in sorted(Status)], dtype=object)


def aligned_rows(run: LoggedRun) -> Iterator[list[Values]]:
    """Values of :data:`ALIGNED_COLUMNS` for a run's estimates in the order of the log, many at a time."""
    count = len(run.estimates["rho"])
    for first in range(0, count, _ROWS) or (0,):
        part = {name: values[first : first + _ROWS] for name, values in run.estimates.items()}
        with np.errstate(over="ignore", invalid="ignore"):
            columns = _columns(run, part)
        yield [columns[column.name] for column in ALIGNED_COLUMNS]


def _columns(run: LoggedRun, estimates: Table) -> dict[str, Values]:
    at_ns = cast("Stamps", estimates["header.stamp"])
    told = _as_judged(estimates, at_ns)
    true = run.truth.at(at_ns)
    return {
        "follower": _texts(run.follower, len(at_ns)),
        "time_ns": at_ns,
        "t": at_ns * _S,
        "t_run": (at_ns - run.zero_ns) * _S,
        **{name: estimates[name] for name in (*SHAPE, *_OWN, *_BOUNDS, "nis", "reason")},
        **{f"sd_{name}": told.sd[:, place] for place, name in enumerate(QUANTITIES)},
        **_certified(run.certified, at_ns),
        "status": _STATUSES[told.status],
        "judged": judged_rows(told, run.evaluation) & _can_be(estimates),
        **_true(true),
        **_errors(told, true),
        **_in_force(run.commands, at_ns),
        "delay_measured": (at_ns - estimates["measured"]) * _S,
        "delay_computed": (estimates["computed"] - at_ns) * _S,
        "delay_commanded": _commanded(run.commands, at_ns),
        **_refused(run.refusals, at_ns),
    }


def _can_be(estimates: Table) -> Array:
    """What the judge leaves out of a log is judged in no table either."""
    return can_be_rows(estimates, _variances(estimates))


def _variances(estimates: Table) -> FloatArray:
    diagonal = [estimates[f"covariance.{DIAGONAL * place}"] for place in range(len(QUANTITIES))]
    return np.column_stack(diagonal)


def _as_judged(estimates: Table, at_ns: Stamps) -> EstimateColumns:
    numbers = {name: cast("FloatArray", values) for name, values in estimates.items()}
    variances = _variances(estimates)
    seen = Perceived(*(numbers[name] for name in (*SHAPE[:-1], *_OWN)))
    return EstimateColumns(
        capture_ns=at_ns,
        status=estimates["status"].astype(np.int64),
        seen=seen,
        u1=numbers["u1"],
        nis=numbers["nis"],
        sd=np.sqrt(np.where(variances >= 0.0, variances, math.nan)),
    )


def _true(true: TrueStates) -> dict[str, Values]:
    poses = np.column_stack([true.leader, true.follower])
    known = {name: getattr(true, name) for name in (*SHAPE, *_OWN)}
    known |= dict(zip(TRUE_POSES, poses.T, strict=True))
    return {f"true_{name}": np.ascontiguousarray(values) for name, values in known.items()}


def _errors(told: EstimateColumns, true: TrueStates) -> dict[str, Values]:
    unknown = np.full(len(told.capture_ns), math.nan)
    errors = dict.fromkeys(SHAPE, unknown) | dict(errors_at(told, true))
    errors["rho"] = told.seen.rho - true.rho
    errors["alpha2"] = np.asarray(wrap(np.asarray(told.seen.alpha2 - true.alpha2)))
    return {f"error_{name}": error for name, error in errors.items()}


def _certified(certified: Table, at_ns: Stamps) -> dict[str, Values]:
    order = np.argsort(certified["header.stamp"], kind="stable")
    stamps = certified["header.stamp"][order]
    place, there = _last_at(stamps, at_ns)
    same = there & (stamps[place] == at_ns) if len(stamps) else there
    radii = {name: _where(same, certified[name], order, place) for name in _RADII}
    return {**radii, "certificate_failed": _words(same, certified["failed"], order, place)}


def _in_force(commands: Table, at_ns: Stamps) -> dict[str, Values]:
    """The last command that was issued by then."""
    order = np.argsort(commands["header.stamp"], kind="stable")
    issued = commands["header.stamp"][order]
    place, there = _last_at(issued, at_ns)
    numbers = {name: _where(there, commands[name], order, place) for name in _COMMANDED}
    age = at_ns - _where(there, issued, np.arange(len(issued)), place, np.int64(0))
    return {
        **{f"command_{name}": values for name, values in numbers.items()},
        "command_saturated": _where(there, commands["saturated"].astype(np.float64), order, place),
        "command_stop": _words(there, commands["stop"], order, place),
        "command_age": np.where(there, age * _S, math.nan),
    }


def _commanded(commands: Table, at_ns: Stamps) -> FloatArray:
    """How long after each capture the first command that rests on it was issued [s]."""
    fresh = commands["fresh"].astype(np.bool_)
    issued, captures = commands["header.stamp"][fresh], commands["capture"][fresh]
    order = np.lexsort((issued, captures))
    issued, captures = issued[order], captures[order]
    place = np.minimum(np.searchsorted(captures, at_ns), max(0, len(captures) - 1))
    delay = np.full(len(at_ns), math.nan)
    if len(captures):
        same = captures[place] == at_ns
        delay[same] = (issued[place] - at_ns)[same] * _S
    return delay


def _refused(refusals: Refusals | None, at_ns: Stamps) -> dict[str, Values]:
    if refusals is None:
        return {
            "refused": np.full(len(at_ns), math.nan),
            "refused_by_cause": _texts("", len(at_ns)),
        }
    order = np.arange(len(refusals.at_ns))
    place, there = _last_at(refusals.at_ns, at_ns)
    causes = np.array([*refusals.causes, ""], dtype=object)[:-1]
    return {
        "refused": _where(there, refusals.totals, order, place),
        "refused_by_cause": _words(there, causes, order, place),
    }


def _last_at(times_ns: Array, at_ns: Stamps) -> tuple[Stamps, Array]:
    """Places of the last of increasing times that are no later than others, and which of these have one."""
    place = np.searchsorted(times_ns, at_ns, side="right") - 1
    return np.maximum(place, 0), place >= 0


def _where(
    there: Array, values: Array, order: Array, place: Stamps, missing: float | np.int64 = math.nan
) -> Array:
    """Values at places of an order, where there are some."""
    if not len(values):
        return np.full(len(place), missing)
    return np.where(there, values[order[place]], missing)


def _words(there: Array, texts: Array, order: Array, place: Stamps) -> Array:
    words = _texts("", len(place))
    if len(texts):
        words[there] = texts[order[place]][there]
    return words


def _texts(text: str, count: int) -> Array:
    texts = np.empty(count, dtype=object)
    texts[:] = text
    return texts
