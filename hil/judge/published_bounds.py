"""Whether the bounds held that estimates went out with: what was known before the run, and nothing since."""

from __future__ import annotations

import math

import numpy as np

from estimation.bounds.bound_check import check
from hil.judge.bounds import actual_errors, bound_errors
from hil.judge.columns import Columns
from hil.scenario.schema import Scenario

_NAMES = ("v1", "alpha1", "h")
_ANYTHING = {"v1": math.inf, "alpha1": math.pi, "h": math.inf}
"""Bounds that exclude nothing."""


def judge_published(scenario: Scenario, columns: Columns) -> dict[str, object]:
    """More of the ``bounds`` part of a summary: the bounds as they were published, and what was seen.

    ``published``: per bound of ``bound_v1``, ``bound_alpha1`` and ``bound_h`` the ``median`` over the samples
    and the share that ``says_something`` (of alpha1: is below pi); where the truth is known, ``violations``
    and ``tightness``, the largest error / bound. They rest on the scenario's noise and leader limits alone.
    ``largest_errors_seen``: of every rate and input whose truth is known, the largest error of the samples;
    ``violations`` and ``tightness`` beside it take these for their premise.
    """
    samples, true = columns.samples, columns.true
    if samples.bounds is None or not len(samples.capture_ns):
        return {}
    bounds = dict(zip(_NAMES, samples.bounds.T, strict=True))
    published: dict[str, object] = {
        "median": {name: float(np.median(bound)) for name, bound in bounds.items()},
        "says_something": {name: float(np.mean(bound < _ANYTHING[name])) for name, bound in bounds.items()},
    }
    known = np.isfinite(true.rho) & np.isfinite(true.v1) & np.isfinite(true.alpha1)
    if np.any(known):
        errors = {name: error[known] for name, error in bound_errors(scenario, columns).items()}
        verdict = check(errors, {name: bound[known] for name, bound in bounds.items()})
        published |= {
            "checked": int(np.count_nonzero(known)),
            "violations": verdict.violations,
            "tightness": verdict.tightness,
        }
    seen = {
        name: float(np.nanmax(error))
        for name, error in actual_errors(columns).items()
        if not np.all(np.isnan(error))
    }
    return {"published": published} | ({"largest_errors_seen": seen} if seen else {})
