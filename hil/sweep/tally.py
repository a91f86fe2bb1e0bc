"""One run judged: by the judge of single runs where it can be, in sums that cells add up."""

from __future__ import annotations

import math
import tomllib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from estimation.bounds.bound_check import QUANTITY_OF
from estimation.bounds.error_bounds import Perceived
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray, wrap
from hil.judge.bounds import judge_bounds
from hil.judge.columns import Columns, CommandColumns, EstimateColumns, inside
from hil.judge.estimation import EVERY, WARM_UP_NS, estimate_errors
from hil.judge.evidence import Span
from hil.judge.noise_free_orbit import NoiseFreeOrbit, noise_free_orbit
from hil.judge.true_states import TrueStates
from hil.scenario.files import build_scenario, scenario_text, with_overrides
from hil.scenario.schema import Scenario
from hil.sweep import engine_kernels as kernels
from hil.sweep.engine import Engine, Flight
from hil.sweep.engine_rules import evaluation_ns

BOUNDS = tuple(QUANTITY_OF)
_COUNT, _MEASURE = np.int64, np.float64
TALLY = np.dtype(
    [
        ("samples", _COUNT),
        ("untracked", _COUNT),
        ("diverged", _COUNT),
        ("nis_count", _COUNT),
        ("nis_sum", _MEASURE),
        ("squares", _MEASURE, len(QUANTITIES)),
        ("covered", _COUNT, len(QUANTITIES)),
        ("best_count", _COUNT),
        ("best_sum", _MEASURE, len(QUANTITIES)),
        ("violations", _COUNT, len(BOUNDS)),
        ("tightness", _MEASURE, len(BOUNDS)),
        ("moments", _COUNT),
        ("inside", _COUNT),
        ("rho_min", _MEASURE),
        ("rho_max", _MEASURE),
        ("rho_off_sum", _MEASURE),
        ("alpha1_off_sum", _MEASURE),
    ]
)
"""Of one run: sums and extremes over its samples, or over the moments of its truth, in the evaluated time."""

ALWAYS_NS = 1_000_000_000
"""A run whose last second has no estimate that says TRACKING has diverged."""


def judge_run(
    engine: Engine,
    flight: Flight,
    allowed: tuple[float, float] | None,
    orbit: NoiseFreeOrbit | None,
) -> NDArray[np.void]:
    """Tally (1,) of a run that the engine has just flown.

    ``allowed``: distances that the certificate allows. ``orbit``: that of :func:`orbit_of`. A run has
    diverged if its last second has no estimate that says TRACKING, or if a speed that it believed in was ever
    wrong by more than a leader can drive.
    """
    tally = np.zeros(1, TALLY)
    columns = _columns(engine, flight)
    samples = columns.samples
    tally["samples"] = len(samples.capture_ns)
    tally["untracked"] = np.count_nonzero(inside(columns.estimates.capture_ns, columns.span)) - len(
        samples.capture_ns
    )
    errors = estimate_errors(columns)
    late = samples.capture_ns >= columns.span.to_ns - ALWAYS_NS
    wild = "v1" in errors and bool(np.any(np.abs(errors["v1"]) > engine.scenario.leader.k_v))
    tally["diverged"] = wild or not np.any(late)
    _add_errors(tally, columns, errors)
    _add_formation(tally, columns, allowed, orbit)
    if len(samples.capture_ns):
        verdict = judge_bounds(engine.scenario, columns)
        for name in ("violations", "tightness"):
            given = verdict[name]
            if isinstance(given, dict):
                tally[name] = [given[bound] for bound in BOUNDS]
        _add_least(tally, engine, flight, columns)
    return tally


def _columns(engine: Engine, flight: Flight) -> Columns:
    """The run as the judge sees it, its time counted from when the leader set off; truth in the span only."""
    from_ns, to_ns = evaluation_ns(engine.scenario)
    run, span = Span(0, to_ns), Span(from_ns, to_ns)
    rows = _rows_inside(flight, span)
    truth = true_states(flight, rows)
    estimates = _estimates(engine, flight)
    judged = inside(estimates.capture_ns, span) & (estimates.status == Status.TRACKING)
    true = _rows(truth, flight.told["frame"][judged] - rows.start)
    commands = CommandColumns.of(())
    return Columns(run, span, estimates, commands, truth, estimates.only(judged), true)


def _rows_inside(flight: Flight, span: Span) -> slice:
    """Frames of a span, its ends included."""
    captures_ns = flight.frames["at_ns"]
    first = np.searchsorted(captures_ns, flight.since_ns + span.from_ns)
    return slice(int(first), int(np.searchsorted(captures_ns, flight.since_ns + span.to_ns, side="right")))


def _estimates(engine: Engine, flight: Flight) -> EstimateColumns:
    found = engine.estimates()
    # All of its fields are floats: one turn of the table gives every column.
    columns = dict(zip(_FIELDS, found.view(np.float64).reshape(-1, len(_FIELDS)).T.copy(), strict=True))
    variances = np.column_stack([columns[f"var_{name}"] for name in QUANTITIES])
    return EstimateColumns(
        capture_ns=flight.frames["at_ns"][flight.told["frame"]] - flight.since_ns,
        status=flight.told["status"].copy(),
        seen=Perceived(*(columns[name] for name in _SEEN)),
        u1=columns["u1"],
        nis=flight.told["nis"].copy(),
        sd=np.sqrt(np.maximum(variances, 0.0)),
    )


def true_states(flight: Flight, rows: slice) -> TrueStates:
    """The truth at frames, its time counted from when the leader set off."""
    frames = flight.frames[rows]
    told = {name: frames[f"true_{name}"].copy() for name in _TOLD}
    dx, dy = told["fx"] - told["lx"], told["fy"] - told["ly"]
    rho, line = np.sqrt(dx * dx + dy * dy), np.arctan2(dy, dx)
    leader, follower = wrap(told["lheading"]), wrap(told["fheading"])
    alpha1, alpha2 = wrap(line - leader), wrap(line - follower + math.pi)
    ahead, aside = told["v1"] * np.cos(alpha1), told["v1"] * np.sin(alpha1)
    own_ahead, own_aside = told["v2"] * np.cos(alpha2), told["v2"] * np.sin(alpha2)
    return TrueStates(
        capture_ns=frames["at_ns"] - flight.since_ns,
        leader=np.column_stack([told["lx"], told["ly"], leader]),
        follower=np.column_stack([told["fx"], told["fy"], follower]),
        v1=told["v1"],
        u1=told["u1"],
        v2=told["v2"],
        u2=told["u2"],
        rho=rho,
        alpha1=alpha1,
        alpha2=alpha2,
        rho_dot=-ahead - own_ahead,
        alpha2_dot=(aside + own_aside) / rho - told["u2"],
    )


_FIELDS = kernels.ESTIMATE.names or ()
_SEEN = ("rho", "alpha2", "rho_dot", "alpha2_dot", "v1", "alpha1", "v2", "u2")
_TOLD = ("lx", "ly", "lheading", "fx", "fy", "fheading", "v1", "u1", "v2", "u2")


def _rows(truth: TrueStates, rows: NDArray[np.int64]) -> TrueStates:
    return TrueStates(**{name: getattr(truth, name)[rows] for name in TrueStates.__slots__})


def _add_errors(tally: NDArray[np.void], columns: Columns, errors: dict[str, FloatArray]) -> None:
    nis = columns.samples.nis[np.isfinite(columns.samples.nis)]
    tally["nis_count"], tally["nis_sum"] = len(nis), nis.sum()
    for k, name in enumerate(QUANTITIES):
        if name in errors:
            tally["squares"][0, k] = np.sum(errors[name] ** 2)
            within = np.abs(errors[name]) <= 3.0 * columns.samples.sd[:, k]
            tally["covered"][0, k] = np.count_nonzero(within)


def _add_least(tally: NDArray[np.void], engine: Engine, flight: Flight, columns: Columns) -> None:
    """Posterior Cramer-Rao bound at every eighth sample, as in the summary of a single run."""
    captures_ns, samples_ns = flight.frames["at_ns"], columns.samples.capture_ns
    first = int(np.searchsorted(captures_ns, flight.since_ns + columns.span.from_ns - WARM_UP_NS))
    others = np.flatnonzero(np.diff(samples_ns, prepend=-1))  # several may tell of one capture
    rows = np.searchsorted(captures_ns, flight.since_ns + samples_ns[others[::EVERY]])
    wanted = np.zeros(rows[-1] + 1, dtype=np.bool_)
    wanted[rows] = True
    least = engine.least_variances(first, wanted)
    tally["best_count"] = least.count
    tally["best_sum"][0] = [least.count * least.variances[name] for name in QUANTITIES]


def _add_formation(
    tally: NDArray[np.void],
    columns: Columns,
    allowed: tuple[float, float] | None,
    orbit: NoiseFreeOrbit | None,
) -> None:
    truth = columns.truth
    rho, alpha1 = truth.rho, truth.alpha1
    tally["moments"], tally["rho_min"], tally["rho_max"] = len(rho), rho.min(), rho.max()
    if allowed is not None:
        tally["inside"] = np.count_nonzero((rho >= allowed[0]) & (rho <= allowed[1]))
    if orbit is None:
        tally["rho_off_sum"] = tally["alpha1_off_sum"] = math.nan
        return
    orbit_rho, orbit_alpha1, _ = orbit.at(truth.capture_ns)
    tally["rho_off_sum"] = np.sum((rho - orbit_rho) ** 2)
    tally["alpha1_off_sum"] = np.sum(wrap(alpha1 - orbit_alpha1) ** 2)


def orbit_of(scenario: Scenario) -> NoiseFreeOrbit | None:
    """Noise-free run that the runs of all cells are held against, from when the leader set off.

    The leader drives the same in all of them, so that one run without losses tells how.
    """
    calm = ["mocap.loss=0", "mocap.latency_s=0.03", "estimator.kind=ekf", "run.seed=0"]
    calm += [
        f"{part}.sigma_{what}=0.0003" for part in ("mocap", "estimator") for what in ("position", "heading")
    ]
    return _orbit(scenario_text(with_overrides(scenario, calm)))


@lru_cache(maxsize=4)
def _orbit(text: str) -> NoiseFreeOrbit | None:
    scenario = build_scenario(tomllib.loads(text))
    flight, run = Engine(scenario).fly(0), Span(0, evaluation_ns(scenario)[1])
    return noise_free_orbit(scenario, true_states(flight, _rows_inside(flight, run)), run)
