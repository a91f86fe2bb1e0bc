"""What an import gave, and what a recording tells of itself: its rate, its gaps, what it was taken for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from formation.angles import FloatArray
from hil.recordings.pair_log import Recorded, Times, known_rows
from hil.recordings.plausibility import doubts
from hil.scenario.files import with_overrides
from hil.scenario.schema import Scenario

_NS = 1e-9
_BURSTS = 2.0  # times the usual spacing of rows, from which on it is that within bursts


@dataclass(frozen=True, slots=True)
class Imported:
    """Rows read, messages written, and the times [s] of the first and the last row.

    ``taken_for``: what the recording was taken for. ``gaps``: rows without it, of the leader, the follower,
    its motion, where there are some. ``doubts``: what does not look right. ``damage``: what was left out as
    it is damaged, a phrase each.
    """

    rows: int
    messages: int
    from_s: float
    to_s: float
    taken_for: str = ""
    gaps: dict[str, int] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    damage: tuple[str, ...] = ()


def imported(
    recorded: Recorded, scenario: Scenario, messages: int, taken_for: str, damage: Sequence[str]
) -> Imported:
    """What an import of these rows with this scenario gave."""
    gaps = {
        role: missing
        for role, values in (("leader", recorded.leader), ("follower", recorded.follower))
        if (missing := _missing(values))
    }
    from_s, to_s = recorded.t_ns[0] * _NS, recorded.t_ns[-1] * _NS
    return Imported(
        rows=len(recorded.t_ns),
        messages=messages,
        from_s=float(from_s),
        to_s=float(to_s),
        taken_for=taken_for,
        gaps=gaps,
        doubts=doubts(recorded, scenario),
        damage=tuple(damage),
    )


def rate_of(t_ns: Times) -> float:
    """Rows per second, as most of them have it, or bursts of rows if they come so; 0 for a single one."""
    if len(t_ns) < 2:
        return 0.0
    middle, period = float(np.median(np.diff(t_ns))), period_ns(t_ns)
    return 1e9 / (period if period > _BURSTS * middle else middle)


def period_ns(t_ns: Times) -> float:
    """Time between two rows [ns] that most of the time is as long or longer; 0 for a single one.

    Of rows that come in bursts it is that between bursts; a gap of half of a recording does not count.
    """
    spacing = np.sort(np.diff(t_ns).astype(np.float64))
    if not spacing.size:
        return 0.0
    passed = np.cumsum(spacing)
    return float(spacing[np.searchsorted(passed, 0.25 * passed[-1])])


def at_rate_of(recorded: Recorded, scenario: Scenario) -> Scenario:
    """The scenario with the rate of a recording's frames."""
    measured = recorded.leader if recorded.leader is not None else recorded.sighting
    if measured is None:
        return scenario
    rate = rate_of(recorded.t_ns[known_rows(measured)])
    if not 1.0 <= rate <= 1000.0:
        return scenario
    return with_overrides(scenario, {"mocap.rate_hz": float(f"{rate:.6g}")})


def _missing(values: FloatArray | None) -> int:
    return 0 if values is None else int(np.count_nonzero(~known_rows(values)))
