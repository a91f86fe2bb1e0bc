"""Figures of each pair of a chain, simulated or driven: when it settled, what it asked for, where it went."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.chain import ChainTrajectory
from formation.angles import FloatArray
from formation.station import Station
from hil.judge.columns import command_columns, true_states
from hil.judge.run_data import RunData, run_span
from hil.judge.true_states import TrueStates

_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Closeness:
    """How close is close: distance within a ``share`` of rho_0, both bearings within an ``angle`` [rad]."""

    share: float
    angle: float


EXACTLY = Closeness(0.02, math.radians(1.0))
"""A noise-free pair keeps its station."""

DRIVEN = Closeness(0.05, math.radians(5.0))
"""A driven pair does, whose estimates, actuators and commands in steps let it waver."""


def settling_times(
    trajectory: ChainTrajectory, rho_0: float, station: Station, close: Closeness
) -> list[float | None]:
    """For each pair the time [s] from which on it keeps its station to the end, None if it doesn't."""
    away = np.abs(trajectory.rho / rho_0 - 1.0) > close.share
    for angle, desired in ((trajectory.alpha1, station.alpha1), (trajectory.alpha2, station.alpha2)):
        away |= np.cos(angle - desired) < math.cos(close.angle)
    found: list[float | None] = []
    for pair in range(away.shape[1]):
        rows = np.flatnonzero(away[:, pair])
        after = int(rows[-1]) + 1 if len(rows) else 0
        found.append(float(trajectory.t[after]) if after < len(trajectory.t) else None)
    return found


def pair_figures(
    trajectory: ChainTrajectory, pair: int, settled: float | None, v_max: float
) -> dict[str, float | None]:
    """``settle_s`` as given, and of the pair and its follower what the trajectory tells.

    ``rho_final``, ``rho_min``, ``rho_max``; ``v_peak`` of the follower within its limit and
    ``v_wanted_peak`` that the law asked for; ``saturated_from_s``, when it first asked for more than the
    limit, None if it never did.
    """
    wanted, rho = np.abs(trajectory.wanted[:, pair + 1]), trajectory.rho[:, pair]
    beyond = np.flatnonzero(wanted > v_max * (1.0 + _ROUNDING))
    return {
        "rho_final": float(rho[-1]),
        "settle_s": settled,
        "v_peak": float(np.abs(trajectory.v[:, pair + 1]).max()),
        "saturated_from_s": float(trajectory.t[beyond[0]]) if len(beyond) else None,
        "v_wanted_peak": float(wanted.max()),
        "rho_min": float(rho.min()),
        "rho_max": float(rho.max()),
    }


def driven_trajectory(runs: Sequence[RunData]) -> ChainTrajectory | None:
    """Trajectory of a chain that was driven, from the run data of its pairs, the leader's first.

    It runs from when the leader set off to the stop, at the moments at which the truth of all pairs is
    known; None where that is fewer than two. ``wanted`` is what the follower's newest command had asked for,
    where it was told to stand what it drove.
    """
    span = run_span(runs[0])
    truths = [true_states(run_data) for run_data in runs]
    moments_ns = truths[0].capture_ns
    for each in truths[1:]:
        moments_ns = np.intersect1d(moments_ns, each.capture_ns)
    moments_ns = moments_ns[(moments_ns >= span.from_ns) & (moments_ns <= span.to_ns)]
    pairs = [each.at(moments_ns) for each in truths]
    rho = np.column_stack([each.rho for each in pairs])
    if len(moments_ns) < 2 or not np.all(np.isfinite(rho)):
        return None
    wanted = [_wanted(run_data, each) for run_data, each in zip(runs, pairs, strict=True)]
    return ChainTrajectory(
        t=np.asarray((moments_ns - span.from_ns) * 1e-9, dtype=np.float64),
        rho=rho,
        alpha1=np.column_stack([each.alpha1 for each in pairs]),
        alpha2=np.column_stack([each.alpha2 for each in pairs]),
        wanted=np.column_stack([pairs[0].v1, *wanted]),
        v=np.column_stack([pairs[0].v1, *(each.v2 for each in pairs)]),
        u=np.column_stack([pairs[0].u1, *(each.u2 for each in pairs)]),
        poses=np.stack([pairs[0].leader, *(each.follower for each in pairs)], axis=1),
    )


def _wanted(run_data: RunData, states: TrueStates) -> FloatArray:
    commands = command_columns(run_data)
    asked = np.concatenate([[math.nan], commands.v2_wanted])
    newest = asked[np.searchsorted(commands.issued_ns, states.capture_ns, side="right")]
    return np.where(np.isfinite(newest), newest, states.v2)
