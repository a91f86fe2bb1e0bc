"""One run judged: by the judge of single runs where it can be, in sums that cells add up."""

from __future__ import annotations

import math
import tomllib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from controllers.guard import StopReason
from estimation.bounds.bound_check import QUANTITY_OF
from estimation.bounds.error_bounds import Perceived
from estimation.consistency.nees import squared_sum
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray, wrap
from hil.judge.bounds import judge_bounds
from hil.judge.columns import Columns, CommandColumns, EstimateColumns, inside
from hil.judge.estimation import WARM_UP_NS, estimate_errors, least_deviations
from hil.judge.noise_free_orbit import NoiseFreeOrbit, noise_free_orbit
from hil.judge.run_data import Span, judged_from_ns
from hil.judge.side_orders import Order, desired_bearings
from hil.judge.true_states import TrueStates, run_of
from hil.lockstep.flyer import Flown, Flyer
from hil.scenario.files import build_scenario, scenario_text, with_overrides
from hil.scenario.links import links_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.schema import Scenario

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
        ("nees_count", _COUNT, len(QUANTITIES)),
        ("nees_sum", _MEASURE, len(QUANTITIES)),
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
        ("rho_station_sum", _MEASURE),
        ("alpha1_station_sum", _MEASURE),
        ("law_failed", _COUNT),
    ]
)
"""Of one run: sums and extremes over its samples, or over the moments of its truth, in the evaluated time."""

ALWAYS_NS = 1_000_000_000
"""A run whose last second has no estimate that says TRACKING has diverged."""


_SEEN = ("rho", "alpha2", "rho_dot", "alpha2_dot", "v1", "alpha1", "v2", "u2")
_VARIANCES = ("r_r", "a_a", "v_v", "b_b", "u_u")
_TRUE = (
    *((body, name) for body in ("leader", "follower") for name in ("x", "y", "theta")),
    *((f"{body}_motion", name) for body in ("leader", "follower") for name in ("v", "u")),
)


def run_span(scenario: Scenario) -> Span:
    """From when the leader sets off to the stop, in time from its start."""
    return Span(0, round(scenario.run.duration_s * 1e9))


def judged_span(scenario: Scenario) -> Span:
    """What is judged of a run, in time from the leader's start."""
    run = run_span(scenario)
    return Span(judged_from_ns(scenario, 0, run), run.to_ns)


def judge_run(
    scenario: Scenario,
    flown: Flown,
    allowed: tuple[float, float] | None,
    orbit: NoiseFreeOrbit | None,
) -> NDArray[np.void]:
    """Tally (1,) of a run; in a chain all its pairs are added up.

    ``allowed``: distances that the certificate allows. ``orbit``: that of :func:`orbit_of`. Both are about
    the first pair, which alone is held against them. A run has diverged if the last second of a pair has no
    estimate that says TRACKING, or if a speed that was believed in was ever wrong by more than a leader can
    drive.
    """
    tally = np.zeros(1, TALLY)
    tally["rho_min"], tally["rho_max"] = math.inf, -math.inf
    tally["law_failed"] = np.count_nonzero(flown.commands["command"]["reason"] == StopReason.NOT_FINITE.code)
    for k, link in enumerate(links_of(scenario)):
        columns = columns_of_pair(link.scenario, flown, k)
        _add_estimates(tally, link.scenario, columns, flown)
        truth = _within(columns.truth, columns.span)
        _add_distances(tally, truth)
        if k == 0:
            _add_formation(tally, truth, allowed, orbit)
            _add_station(tally, link.scenario, truth)
    return tally


def columns_of_pair(scenario: Scenario, flown: Flown, k: int) -> Columns:
    """The k-th pair of a run as the judge sees it, its time counted from when the leader set off."""
    span = judged_span(scenario)
    estimates = _estimates(flown, k)
    judged = inside(estimates.capture_ns, span) & (estimates.status == Status.TRACKING)
    samples = estimates.only(judged)
    truth = true_states(flown, k, Span(span.from_ns - WARM_UP_NS, span.to_ns))
    run = run_of(truth.capture_ns, samples.capture_ns)
    true = _rows(truth, np.searchsorted(truth.capture_ns, samples.capture_ns) if run is None else run)
    return Columns(run_span(scenario), span, estimates, CommandColumns.of(()), truth, samples, true)


def true_states(flown: Flown, k: int, span: Span) -> TrueStates:
    """The truth of the k-th pair at the captures of a span, its time counted from when the leader set off."""
    rows = flown.truth[k :: flown.pairs]
    moments_ns = rows["at_ns"] - flown.since_ns
    rows = rows[np.searchsorted(moments_ns, span.from_ns) : np.searchsorted(moments_ns, span.to_ns, "right")]
    recorded = np.empty((len(_TRUE), len(rows))).T
    for column, (body, name) in enumerate(_TRUE):
        recorded[:, column] = rows[body][name]
    return TrueStates.along(rows["at_ns"] - flown.since_ns, recorded)


def _estimates(flown: Flown, k: int) -> EstimateColumns:
    rows = flown.estimates if flown.pairs == 1 else flown.estimates[flown.estimates["follower"] == k]
    found = rows["estimate"]
    variances = np.empty((len(_VARIANCES), len(found))).T
    for column, name in enumerate(_VARIANCES):
        variances[:, column] = found["joint"][name]
    return EstimateColumns(
        capture_ns=found["capture_ns"] - flown.since_ns,
        status=found["status"].copy(),
        seen=Perceived(*(found[name].copy() for name in _SEEN)),
        u1=found["u1"].copy(),
        nis=found["nis"].copy(),
        sd=np.sqrt(np.maximum(variances, 0.0)),
    )


def _rows(truth: TrueStates, rows: NDArray[np.int64] | slice) -> TrueStates:
    return TrueStates(**{name: getattr(truth, name)[rows] for name in TrueStates.__slots__})


def _add_estimates(tally: NDArray[np.void], scenario: Scenario, columns: Columns, flown: Flown) -> None:
    samples, errors = columns.samples, estimate_errors(columns)
    judged = np.count_nonzero(inside(columns.estimates.capture_ns, columns.span))
    tally["samples"] += len(samples.capture_ns)
    tally["untracked"] += judged - len(samples.capture_ns)
    late = samples.capture_ns >= columns.span.to_ns - ALWAYS_NS
    wild = "v1" in errors and bool(np.any(np.abs(errors["v1"]) > scenario.leader.k_v))
    tally["diverged"] |= int(wild or not np.any(late))
    _add_errors(tally, columns, errors)
    if not len(samples.capture_ns):
        return
    verdict = judge_bounds(scenario, columns)
    violations, tightness = verdict["violations"], verdict["tightness"]
    if isinstance(violations, dict) and isinstance(tightness, dict):
        tally["violations"] += [violations[bound] for bound in BOUNDS]
        tally["tightness"] = np.maximum(tally["tightness"], [tightness[bound] for bound in BOUNDS])
    received_ns = flown.truth["at_ns"][flown.truth["arrives"]] - flown.since_ns
    for place, bound in enumerate(least_deviations(scenario, columns, received_ns, emulated=True).values()):
        known = bound[np.isfinite(bound)]
        tally["best_sum"][0, place] += np.sum(known * known)
        if place == 0:
            tally["best_count"] += len(known)


def _add_errors(tally: NDArray[np.void], columns: Columns, errors: dict[str, FloatArray]) -> None:
    nis = columns.samples.nis[np.isfinite(columns.samples.nis)]
    tally["nis_count"] += len(nis)
    tally["nis_sum"] += nis.sum()
    for k, name in enumerate(QUANTITIES):
        if name in errors:
            sd = columns.samples.sd[:, k]
            total, count = squared_sum(errors[name], sd)
            tally["squares"][0, k] += np.sum(errors[name] ** 2)
            tally["covered"][0, k] += np.count_nonzero(np.abs(errors[name]) <= 3.0 * sd)
            tally["nees_count"][0, k] += count
            tally["nees_sum"][0, k] += total


def _within(truth: TrueStates, span: Span) -> TrueStates:
    """The truth at the moments of a span, its ends included, as a view."""
    first = np.searchsorted(truth.capture_ns, span.from_ns)
    after = np.searchsorted(truth.capture_ns, span.to_ns, "right")
    return _rows(truth, slice(int(first), int(after)))


def _add_distances(tally: NDArray[np.void], truth: TrueStates) -> None:
    tally["rho_min"] = np.minimum(tally["rho_min"], truth.rho.min())
    tally["rho_max"] = np.maximum(tally["rho_max"], truth.rho.max())


def _add_formation(
    tally: NDArray[np.void],
    truth: TrueStates,
    allowed: tuple[float, float] | None,
    orbit: NoiseFreeOrbit | None,
) -> None:
    rho, alpha1 = truth.rho, truth.alpha1
    tally["moments"] = len(rho)
    if allowed is not None:
        tally["inside"] = np.count_nonzero((rho >= allowed[0]) & (rho <= allowed[1]))
    if orbit is None:
        tally["rho_off_sum"] = tally["alpha1_off_sum"] = math.nan
        return
    orbit_rho, orbit_alpha1, _ = orbit.at(truth.capture_ns)
    tally["rho_off_sum"] = np.sum((rho - orbit_rho) ** 2)
    tally["alpha1_off_sum"] = np.sum(wrap(alpha1 - orbit_alpha1) ** 2)


def _add_station(tally: NDArray[np.void], scenario: Scenario, truth: TrueStates) -> None:
    orders = [Order(round(at_s * 1e9), side) for at_s, side in ordered_sides(scenario)]
    alpha1, _ = desired_bearings(scenario, orders, truth.capture_ns)
    tally["rho_station_sum"] = np.sum((truth.rho - scenario.formation.rho_0) ** 2)
    tally["alpha1_station_sum"] = np.sum(wrap(truth.alpha1 - alpha1) ** 2)


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
    run = run_span(scenario)
    flown = Flyer(scenario, after_s=0.0).fly(0)
    return noise_free_orbit(scenario, true_states(flown, 0, run), run)
