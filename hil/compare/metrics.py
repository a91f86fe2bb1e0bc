"""Metrics of a summary or of a sweep's cell by their dotted names: which way is better, and in which unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from hil.judge.dotted_figures import HEADLINES as RUN_HEADLINES
from hil.judge.dotted_figures import bare, figures_of
from hil.reports.run_tables import QUANTITIES, scale_of

LOWER, HIGHER, NEAR = "lower", "higher", "near"


@dataclass(frozen=True, slots=True)
class Goal:
    """Which way a metric is better: ``lower``, ``higher``, or ``near`` a value."""

    direction: str
    value: float = math.nan

    def cost(self, value: float) -> float:
        """What is less the better a value is; near a value the same for half and twice of that."""
        if self.direction == LOWER:
            return value
        if self.direction == HIGHER:
            return -value
        return abs(math.log(value / self.value)) if value > 0.0 else math.inf

    def __str__(self) -> str:
        return f"near {self.value:g}" if self.direction == NEAR else self.direction


_GOALS = {
    "estimation.rmse.*": Goal(LOWER),
    "estimation.max.*": Goal(LOWER),
    "estimation.efficiency.*": Goal(LOWER),
    "estimation.settle_s": Goal(LOWER),
    "estimation.untracked": Goal(LOWER),
    "estimation.nis_mean": Goal(NEAR, 2.0),
    "estimation.nees.*": Goal(NEAR, 1.0),
    "estimation.coverage_3sigma.*": Goal(HIGHER),
    "bounds.violations.*": Goal(LOWER),
    "bounds.published.violations.*": Goal(LOWER),
    "bounds.published.median.*": Goal(LOWER),
    "bounds.input_errors_hold.*": Goal(HIGHER),
    "certified.failed.*": Goal(LOWER),
    "certified.*.violations": Goal(LOWER),
    "certified.*.median": Goal(LOWER),
    "certified.*.largest": Goal(LOWER),
    "certified.certified": Goal(HIGHER),
    "formation.orbit_deviation_rms.*": Goal(LOWER),
    "formation.equilibrium_deviation_rms.*": Goal(LOWER),
    "formation.deviation.*": Goal(LOWER),
    "formation.equilibrium_deviation.*": Goal(LOWER),
    "formation.certified": Goal(HIGHER),
    "latency_ms.*": Goal(LOWER),
    "cycles.late": Goal(LOWER),
    "cycles.longest_ms": Goal(LOWER),
    "clock.jitter_ms.*": Goal(LOWER),
    "frames.lost": Goal(LOWER),
    "frames.late": Goal(LOWER),
    "frames.rejected": Goal(LOWER),
    "commands.saturated": Goal(LOWER),
    "commands.stopped": Goal(LOWER),
    "rejected.*": Goal(LOWER),
    "parity.*.mismatched": Goal(LOWER),
    "findings": Goal(LOWER),
    "diverged": Goal(LOWER),
    "untracked": Goal(LOWER),
    "law_failed": Goal(LOWER),
    "rmse.*": Goal(LOWER),
    "efficiency.*": Goal(LOWER),
    "nis_mean": Goal(NEAR, 2.0),
    "nees.*": Goal(NEAR, 1.0),
    "coverage_3sigma.*": Goal(HIGHER),
}
"""Those of summaries, then those of a sweep's cells; of a metric that is not here nobody can say."""

OFF_RUN = frozenset({"formation.orbit_deviation_rms.rho", "formation.deviation.rho"})
OFF_STATION = frozenset({"formation.equilibrium_deviation_rms.rho", "formation.equilibrium_deviation.rho"})
"""How well the formation was kept, of runs and of cells: against what the law does by itself, and at all."""

HEADLINES = {
    **RUN_HEADLINES,
    "rmse.v1": "RMSE of v1",
    "rmse.alpha1": "RMSE of alpha1",
    **dict.fromkeys(sorted(OFF_RUN), "rho off its own noise-free run"),
    **dict.fromkeys(sorted(OFF_STATION), "rho off the station"),
}
"""What a verdict may be about, in its words, and what is told first."""

BROKEN = {
    "bounds.violations.*_extended": "samples outside an extended bound",
    "bounds.published.violations.*": "samples outside a published bound",
    "certified.*.violations": "samples outside a certified radius",
    "parity.*.mismatched": "messages that a replay did not repeat",
    "diverged": "diverged runs",
}
"""What should be none at all, in words: where it is less, that comes before all else."""

UNTRACKED = {"estimation.untracked": "estimation.samples", "untracked": "samples"}
"""Estimates that did not say tracking, and the name of those that did."""

_FIRST = (
    *HEADLINES,
    *BROKEN,
    "estimation.rmse.*",
    "estimation.settle_s",
    "estimation.nees.v1",
    "estimation.nees.alpha1",
    "bounds.published.median.v1",
    "bounds.published.median.alpha1",
    *UNTRACKED,
    "formation.orbit_deviation_rms.*",
    "formation.equilibrium_deviation_rms.*",
    "formation.rho_min",
    "formation.rho_max",
    "formation.certified",
    "latency_ms.*.p50",
    "latency_ms.*.p99",
    "cycles.late",
    "frames.lost",
    "frames.rejected",
    "commands.saturated",
    "commands.stopped",
    "findings",
    "rmse.*",
    "efficiency.v1",
    "efficiency.alpha1",
    "nees.v1",
    "nees.alpha1",
)
"""What a table shows, in its order."""

_NO_METRICS = (
    *("seed", "agents", "duration_s", "noise", "runs", "worst_run", "kept", "log", "certificate", "law"),
    *("estimator", "sigma_position", "sigma_heading", "latency_s", "loss", "parameters", "stopped_by"),
    *(
        "estimation.evaluated_from_s",
        "estimation.max_at_s",
        "window",
        "bounds.checked",
        "bounds.assumed",
        "bounds.published.checked",
    ),
    *("bounds.published.says_something", "bounds.largest_errors_seen", "bounds.v_eps"),
    *("frames.used", "frames.published", "frames.received", "commands.sent", "cycles.count"),
    *("cycles.limit_ms",),
)
"""Conditions of a run, and how much of it there was."""


def metrics_of(tree: Mapping[str, Any]) -> dict[str, float]:
    """Metrics of a summary or a cell by dotted names: its figures but for what are conditions."""
    return {name: value for name, value in figures_of(tree).items() if _is_metric(name)}


def _is_metric(name: str) -> bool:
    inner = bare(name)
    return not any(inner == each or inner.startswith(f"{each}.") for each in _NO_METRICS)


def goal_of(name: str) -> Goal | None:
    """Which way a metric is better, None where that is not known."""
    inner = bare(name)
    return next((goal for pattern, goal in _GOALS.items() if fnmatchcase(inner, pattern)), None)


def in_order(names: Iterator[str] | set[str]) -> list[str]:
    """Metrics with those that are told first in front, and only then all others, by name."""
    return sorted(names, key=lambda name: (_rank(name), name))


def is_told(name: str) -> bool:
    """Whether a table has a metric that is short."""
    return _rank(name) < len(_FIRST)


def _rank(name: str) -> int:
    inner = bare(name)
    found = (n for n, pattern in enumerate(_FIRST) if fnmatchcase(inner, pattern))
    return next(found, len(_FIRST))


def unit_of(name: str) -> tuple[str, float]:
    """Unit in which a metric is shown, and what its value in SI units is multiplied by for that."""
    *above, last = bare(name).split(".")
    over = above[-1] if above else ""
    if last in QUANTITIES and over in ("rmse", "max", "median"):
        return QUANTITIES[last][1], scale_of(last)
    if over in ("orbit_deviation_rms", "equilibrium_deviation_rms", "deviation", "equilibrium_deviation"):
        return ("deg", math.degrees(1.0)) if last.startswith("alpha") else ("mm", 1e3)
    if above and above[0] == "formation" and last.startswith(("rho", "alpha")):
        return ("deg", math.degrees(1.0)) if last.startswith("alpha") else ("m", 1.0)
    if any(each.endswith("_ms") for each in (*above, last)):
        return "ms", 1.0
    return ("s", 1.0) if last.endswith("_s") else ("", 1.0)


def shown(name: str, value: float) -> str:
    """A value in the unit of :func:`unit_of`, without it."""
    scaled = unit_of(name)[1] * value
    return f"{scaled:.0f}" if float(scaled).is_integer() and abs(scaled) < 1e6 else f"{scaled:.3g}"
