"""What pictures and reports of a run draw from: its columns with bounds, errors and the noise-free orbit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.bounds.bound_check import ROUNDING
from estimation.tracking.tracker import Status
from formation.angles import FloatArray
from hil.judge.bounds import WorstErrors, bound_errors, named_bounds, worst_errors
from hil.judge.certified import CertifiedColumns
from hil.judge.columns import Columns, EstimateColumns, columns_of
from hil.judge.formation import orbit_of_run
from hil.judge.noise_free_orbit import NoiseFreeOrbit
from hil.judge.run_data import RunData
from hil.judge.side_orders import desired_bearings
from hil.judge.true_states import Stamps, TrueStates

BOUNDED = ("v1", "alpha1", "h")
"""Whose errors have bounds, in the order of those that estimates carry."""

PUBLISHED, SEEN = "published bound", "bound by the largest errors seen"

LONGEST_LINE = 0.5
"""Between samples that are further apart [s] no line is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class PlotData:
    """What is drawn. ``tracked``: estimates of the whole run that say TRACKING, and their truth.

    ``worst``: the largest errors seen, None without judged samples; ``bounds``: the bounds of v1, alpha1 and
    h at the judged samples, in the ``bound_words`` of what they rest on; ``errors``: the sizes of the errors
    of these there; ``orbit``: the noise-free run, where it is known; ``certified``: estimates with guaranteed
    radii, where there are any.
    """

    run_data: RunData
    columns: Columns
    tracked: EstimateColumns
    tracked_true: TrueStates
    worst: WorstErrors | None
    bounds: Mapping[str, FloatArray]
    bound_words: str
    errors: Mapping[str, FloatArray]
    orbit: NoiseFreeOrbit | None
    certified: CertifiedColumns

    @staticmethod
    def of(run_data: RunData) -> PlotData:
        """Gather what is drawn of a run's data."""
        columns = columns_of(run_data)
        orbit = orbit_of_run(run_data, columns)
        during = columns.estimates.capture_ns <= columns.run.to_ns
        tracked = columns.estimates.only((columns.estimates.status == Status.TRACKING) & during)
        worst: WorstErrors | None = None
        bounds: Mapping[str, FloatArray] = {}
        words = PUBLISHED
        errors: Mapping[str, FloatArray] = {}
        if len(columns.samples.capture_ns):
            worst = worst_errors(run_data.scenario, columns)
            bounds, words = _drawn_bounds(run_data, columns, worst)
            errors = bound_errors(run_data.scenario, columns)
        true = columns.truth.at(tracked.capture_ns)
        certified = CertifiedColumns.of(run_data.certified, columns.span)
        return PlotData(run_data, columns, tracked, true, worst, bounds, words, errors, orbit, certified)

    @property
    def truth_name(self) -> str:
        """What the true course of a quantity is called, by what it is taken from."""
        return "truth" if self.run_data.tracks is None else "smoothed mocap"

    def seconds(self, moments_ns: Stamps) -> FloatArray:
        """Moments as seconds of the run."""
        return np.asarray((moments_ns - self.run_data.zero_ns) * 1e-9, dtype=np.float64)

    def desired(self) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
        """Seconds and (rho, alpha1, alpha2) of the station over the run, with a corner at every order."""
        run, scenario, orders = self.columns.run, self.run_data.scenario, self.run_data.orders
        given = [order.given_ns for order in orders if run.from_ns < order.given_ns < run.to_ns]
        corners = np.array([run.from_ns, *(ns for each in given for ns in (each - 1, each)), run.to_ns])
        rho = np.full(len(corners), scenario.formation.rho_0)
        return self.seconds(corners), (rho, *desired_bearings(scenario, orders, corners))


def _drawn_bounds(
    run_data: RunData, columns: Columns, worst: WorstErrors
) -> tuple[Mapping[str, FloatArray], str]:
    """Bounds of v1, alpha1 and h at the judged samples, and in words what they rest on.

    Those that the estimates went out with, as the verdict has them; where these are not known, the extended
    ones by the largest errors seen.
    """
    published = columns.samples.bounds
    if published is not None and not np.all(np.isnan(published)):
        return dict(zip(BOUNDED, published.T, strict=True)), PUBLISHED
    named = named_bounds(run_data.scenario, columns, worst)
    return {name: named[f"{name}_extended"] for name in BOUNDED}, SEEN


def outside(error: FloatArray, bound: FloatArray) -> NDArray[np.bool_]:
    """Samples whose error is known and exceeds its bound."""
    return np.asarray(np.isfinite(error) & (error > bound + ROUNDING))


def with_gaps(t: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values with NaN where the time jumps, so that no line pretends to know what lies between."""
    holes = np.flatnonzero(np.diff(t) > LONGEST_LINE) + 1
    return np.insert(t, holes, math.nan), np.insert(values, holes, math.nan)


def broken_at_jumps(angle: FloatArray) -> FloatArray:
    """Angle with NaN where it passes through pi, so that no line is drawn across the panel."""
    broken = angle.copy()
    broken[1:][np.abs(np.diff(angle)) > math.pi] = math.nan
    return broken
