"""Whether the errors that a scenario lets assume were kept to, and whether the bounds on them held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.bounds.bound_check import QUANTITY_OF, ROUNDING, check
from formation.angles import FloatArray
from hil.judge.bounds import WorstErrors, actual_errors, assumed_errors, bound_errors, named_bounds
from hil.judge.columns import Columns
from hil.scenario.schema import Scenario

_INPUTS = ("E_rho", "E_alpha2", "E_v2", "E_u2")


def judge_assumptions(scenario: Scenario, columns: Columns) -> dict[str, object]:
    """More of the ``bounds`` part of a summary: the bounds on what could be assumed before the run.

    ``input_errors_hold``: per input whose truth is known, and for ``all`` of them together, the share of
    samples at which its error lies within what is assumed. ``assumed``: with bounds on assumed errors alone,
    ``holds``: the share of samples at which each named bound held, and ``where_inputs_hold``: how many
    samples kept to all known assumptions, with the violations and tightness of each bound there. An extended
    bound may be violated only where an assumption is. Empty where no truth is known.
    """
    samples, true = columns.samples, columns.true
    known: NDArray[np.bool_] = np.isfinite(true.rho) & np.isfinite(true.v1) & np.isfinite(true.alpha1)
    if not np.any(known):
        return {}
    assumed = assumed_errors(scenario, samples)
    kept = _kept(columns, assumed, known)
    all_kept = np.logical_and.reduce(list(kept.values()))
    errors = bound_errors(scenario, columns)
    bounds = named_bounds(scenario, columns, WorstErrors.of(assumed))
    held = {
        name: errors[QUANTITY_OF[name]][known] <= bound[known] + ROUNDING for name, bound in bounds.items()
    }
    there = known & all_kept
    verdict = check(_at(errors, there), _at(bounds, there))
    return {
        "input_errors_hold": {name: float(np.mean(each[known])) for name, each in kept.items()}
        | {"all": float(np.mean(all_kept[known]))},
        "assumed": {
            "holds": {name: float(np.mean(each)) for name, each in held.items()},
            "where_inputs_hold": {
                "samples": int(np.count_nonzero(there)),
                "violations": verdict.violations,
                "tightness": verdict.tightness,
            },
        },
    }


def _kept(
    columns: Columns, assumed: dict[str, FloatArray | float], known: NDArray[np.bool_]
) -> dict[str, NDArray[np.bool_]]:
    """Per input of known truth, the samples at which its error lies within what is assumed."""
    actual = actual_errors(columns)
    return {
        name: actual[name] <= np.asarray(assumed[name]) + ROUNDING
        for name in _INPUTS
        if np.all(np.isfinite(actual[name][known]))
    }


def _at(values: dict[str, FloatArray], rows: NDArray[np.bool_]) -> dict[str, FloatArray | float]:
    return {name: value[rows] for name, value in values.items()}
