"""Whether the deviations that estimates tell are those of their errors: too modest, or too confident."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from estimation.consistency.nees import effective_samples, nees_limits, normalised
from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray
from hil.judge.columns import EstimateColumns

TOLERATED = (0.5, 2.0)
"""Nobody minds deviations that are off by a factor of 1.4, however surely that is known."""

LEAST_EXPLAINED = 0.9
"""Of sound errors 99.7 % lie within three deviations; that a tenth lies outside happens in 1 of 37 runs at
most, however alike the errors are (Markov's inequality)."""

TELLING = 20.0
"""Where the upper limit is so many times the lower one, errors count for too few samples to tell anything."""

_EXACT = 1e-12
"""Who errs by a millionth of his deviations was given the truth, and what is left is rounding."""


def judge_nees(samples: EstimateColumns, errors: Mapping[str, FloatArray]) -> dict[str, dict[str, Any]]:
    """``nees`` and ``nees_limits`` of judged samples with these errors, by quantity.

    The limits are those of an estimator that is neither, over as many independent samples as these errors
    count for; a quantity of which that is less than one has none.
    """
    nees: dict[str, Any] = {}
    limits: dict[str, Any] = {}
    for name, error in errors.items():
        in_deviations = normalised(error, samples.sd[:, QUANTITIES.index(name)])
        if len(in_deviations):
            nees[name] = float(in_deviations @ in_deviations) / len(in_deviations)
            exact = nees[name] < _EXACT
            limits[name] = None if exact else nees_limits(effective_samples(in_deviations))
    return {"nees": nees, "nees_limits": limits}


def are_telling(limits: Sequence[float]) -> bool:
    """Whether limits are so narrow that a value outside of them says something."""
    low, high = limits
    return high <= TELLING * low


def nees_finding(estimation: Mapping[str, Any]) -> str:
    """What is wrong with the deviations of the ``estimation`` of a summary, or a cell, in one line.

    Errors that never change count for one sample, of which nearly any NEES could be: limits that are not
    telling count as none. Deviations are too small all the same where they explain so few of the errors.
    """
    limits, covered = estimation.get("nees_limits", {}), estimation.get("coverage_3sigma", {})
    modest, confident = [], []
    for name, nees in estimation.get("nees", {}).items():
        given = limits.get(name)
        low, high = given if given and are_telling(given) else (0.0, math.inf)
        share = covered.get(name, 1.0)
        expected = f" (expected {low:.2g} to {high:.2g})" if math.isfinite(high) else ""
        if nees < min(low, TOLERATED[0]):
            modest.append(f"{name} {nees:.2g}{expected}")
        if nees > max(high, TOLERATED[1]):
            confident.append(f"{name} {nees:.2g}{expected}")
        elif nees > TOLERATED[1] and share < LEAST_EXPLAINED:
            confident.append(f"{name} {nees:.2g} ({share:.0%} within 3 deviations, expected 99.7 %)")
    parts = [("too confident", confident), ("too modest", modest)]
    told = [f"deviations are {what}: {', '.join(each)}" for what, each in parts if each]
    return f"mean squared errors over their variances: {'; '.join(told)}" if told else ""


def judged_findings(estimation: Mapping[str, Any]) -> dict[str, str] | None:
    """Findings of the judge itself from the ``estimation`` of a summary, None where no error is known."""
    if not estimation.get("nees"):
        return None
    text = nees_finding(estimation)
    return {"nees": text} if text else {}
