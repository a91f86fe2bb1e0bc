"""Whether the bounds held: errors against their bounds, from rate and input errors known or assumed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimation.bounds.bound_check import SpeedInputs, all_bounds, check, errors_of
from estimation.bounds.error_bounds import InputErrors, RateErrors, Values
from formation.angles import FloatArray, wrap
from formation.spacing import Spacing
from hil.judge.columns import Columns, EstimateColumns
from hil.scenario.certificate import assumptions_of
from hil.scenario.parts import station
from hil.scenario.schema import Scenario
from hil.wire.assumed_errors import AssumedErrors

_NEAREST = 1e-6  # m; nobody is nearer, and bounds divide by the distance


@dataclass(frozen=True, slots=True, eq=False)
class WorstErrors:
    """What the bounds rest on, for all samples."""

    rates: RateErrors
    inputs: InputErrors

    @staticmethod
    def of(errors: Mapping[str, Values]) -> WorstErrors:
        """From errors by name."""
        inputs = InputErrors(errors["E_rho"], errors["E_alpha2"], errors["E_v2"], errors["E_u2"])
        return WorstErrors(RateErrors(errors["M_rho"], errors["M_alpha2"]), inputs)


def judge_bounds(scenario: Scenario, columns: Columns) -> dict[str, object]:
    """The ``bounds`` part of a summary.

    ``M_rho``, ``M_alpha2``: the rate errors that the bounds rest on, of :func:`worst_errors`; where they
    change from sample to sample, the largest. ``checked``: samples at which the truth is known; without any
    there are neither violations nor tightness.
    """
    samples, true = columns.samples, columns.true
    if not len(samples.capture_ns):
        return {"v_eps": scenario.leader.v_eps, "checked": 0}
    given = worst_errors(scenario, columns)
    known = np.isfinite(true.rho) & np.isfinite(true.v1) & np.isfinite(true.alpha1)
    result: dict[str, object] = {
        "M_rho": float(np.max(given.rates.M_rho)),
        "M_alpha2": float(np.max(given.rates.M_alpha2)),
        "v_eps": scenario.leader.v_eps,
        "checked": int(np.count_nonzero(known)),
    }
    if not np.any(known):
        return result
    errors = bound_errors(scenario, columns)
    bounds = named_bounds(scenario, columns, given)
    if not np.all(known):
        errors = {name: error[known] for name, error in errors.items()}
        bounds = {name: bound[known] for name, bound in bounds.items()}
    verdict = check(errors, bounds)
    return result | {"violations": verdict.violations, "tightness": verdict.tightness}


def bound_errors(scenario: Scenario, columns: Columns) -> dict[str, FloatArray]:
    """Size of the errors of v1, alpha1 and h at every sample, NaN where the truth is not known."""
    spacing = Spacing(scenario.formation.rho_0, scenario.controller.mu_rho)
    truth = SpeedInputs(columns.true.rho, columns.true.v1, columns.true.alpha1)
    return errors_of(columns.samples.seen, truth, scenario.controller.mu1, spacing, station(scenario))


def named_bounds(scenario: Scenario, columns: Columns, given: WorstErrors) -> dict[str, FloatArray]:
    """Every named bound at every sample."""
    spacing = Spacing(scenario.formation.rho_0, scenario.controller.mu_rho)
    bounds = all_bounds(
        columns.samples.seen,
        given.rates,
        given.inputs,
        v_eps=scenario.leader.v_eps,
        mu1=scenario.controller.mu1,
        spacing=spacing,
        station=station(scenario),
    )
    n = len(columns.samples.capture_ns)
    return {
        name: bound if np.shape(bound) == (n,) else np.broadcast_to(bound, (n,))
        for name, bound in bounds.items()
    }


def worst_errors(scenario: Scenario, columns: Columns) -> WorstErrors:
    """Bounds of rate and input errors: of a quantity whose truth is known, the samples' largest error.

    Of any other, what may be assumed: see :func:`assumed_errors`.
    """
    errors = actual_errors(columns)
    largest: dict[str, Values] = {
        name: greatest for name, error in errors.items() if not math.isnan(greatest := _largest(error))
    }
    if len(largest) < len(errors):
        largest = assumed_errors(scenario, columns.samples) | largest
    return WorstErrors.of(largest)


def _largest(error: FloatArray) -> float:
    """Largest error that is known, NaN where none is."""
    largest = float(error.max())
    if not math.isnan(largest):
        return largest
    known = error[~np.isnan(error)]
    return float(known.max()) if len(known) else math.nan


def actual_errors(columns: Columns) -> dict[str, FloatArray]:
    """Magnitudes of the errors that go into the bounds, at each sample; NaN where the truth is not known."""
    seen, true = columns.samples.seen, columns.true
    errors = {
        "M_rho": seen.rho_dot - true.rho_dot,
        "M_alpha2": seen.alpha2_dot - true.alpha2_dot,
        "E_rho": seen.rho - true.rho,
        "E_alpha2": wrap(np.asarray(seen.alpha2 - true.alpha2)),
        "E_v2": seen.v2 - true.v2,
        "E_u2": seen.u2 - true.u2,
    }
    return {name: np.abs(error) for name, error in errors.items()}


def assumed_errors(scenario: Scenario, samples: EstimateColumns) -> dict[str, Values]:
    """Bounds of rate and input errors that the scenario alone gives, at each sample's distance.

    Of rates the certificate's error of the leader's velocity, and what is assumed of the follower's own
    motion; of inputs three standard deviations.
    """
    assumed = AssumedErrors.of(scenario)
    nearest = np.maximum(samples.seen.rho, _NEAREST)
    velocity = assumptions_of(scenario, driven=False).velocity_error
    errors = assumed.errors(1.0)
    return {
        "M_rho": np.full(len(nearest), velocity + assumed.E_v2),
        "M_alpha2": velocity / nearest + assumed.E_u2,
        "E_rho": np.full(len(nearest), errors.E_rho),
        "E_alpha2": assumed.bearing_errors(nearest),
        "E_v2": np.full(len(nearest), errors.E_v2),
        "E_u2": np.full(len(nearest), errors.E_u2),
    }
