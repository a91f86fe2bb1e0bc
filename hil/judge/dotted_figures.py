"""Figures of a summary by their dotted names, as tables, comparisons and rankings have them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.log.report_json import flat

HEADLINES = {
    "estimation.rmse.v1": "RMSE of v1",
    "estimation.rmse.alpha1": "RMSE of alpha1",
    "formation.orbit_deviation_rms.rho": "rho off the noise-free run",
}
"""Figures by which one run is told from another first, with their names in words."""

_PAIRS = "pairs."


def figures_of(summary: Mapping[str, Any]) -> dict[str, float]:
    """All finite numbers of a summary by dotted names; those of a chain's pairs by the follower.

    ``findings``: how many there are.
    """
    named = dict(summary)
    if isinstance(pairs := named.pop("pairs", None), list):
        named |= {f"{_PAIRS}{pair['follower']}": _counted(pair) for pair in pairs}
    return {
        name: float(value)
        for name, value in flat(_counted(named))
        if isinstance(value, (int, float)) and math.isfinite(value)
    }


def bare(name: str) -> str:
    """A figure's name without the pair of a chain in front."""
    return name.split(".", 2)[2] if name.startswith(_PAIRS) and name.count(".") > 1 else name


def _counted(tree: Mapping[str, Any]) -> dict[str, Any]:
    found = tree.get("findings")
    return {**tree, "findings": len(found)} if isinstance(found, list) else dict(tree)
