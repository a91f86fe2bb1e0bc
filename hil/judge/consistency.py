"""Whether the deviations that estimates tell are those of their errors: too modest, or too confident."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from estimation.consistency.nees import effective_samples, nees_limits, normalised
from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray
from hil.judge.columns import EstimateColumns

TOLERATED = (0.5, 2.0)
"""Nobody minds deviations that are off by a factor of 1.4, however surely that is known."""

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


def nees_finding(estimation: Mapping[str, Any]) -> str:
    """What is wrong with the deviations of the ``estimation`` of a summary, or a cell, in one line."""
    modest, confident = [], []
    for name, nees, (low, high) in _limited(estimation):
        said = f"{name} {nees:.2g} (expected {low:.2g} to {high:.2g})"
        if nees < min(low, TOLERATED[0]):
            modest.append(said)
        if nees > max(high, TOLERATED[1]):
            confident.append(said)
    parts = [("too confident", confident), ("too modest", modest)]
    told = [f"deviations are {what}: {', '.join(each)}" for what, each in parts if each]
    return f"mean squared errors over their variances: {'; '.join(told)}" if told else ""


def judged_findings(estimation: Mapping[str, Any]) -> dict[str, str] | None:
    """Findings of the judge itself from the ``estimation`` of a summary, None where no error is known."""
    if not estimation.get("nees"):
        return None
    text = nees_finding(estimation)
    return {"nees": text} if text else {}


def _limited(estimation: Mapping[str, Any]) -> Iterator[tuple[str, float, tuple[float, float]]]:
    limits = estimation.get("nees_limits", {})
    for name, nees in estimation.get("nees", {}).items():
        if limits.get(name) is not None:
            low, high = limits[name]
            yield name, nees, (low, high)
