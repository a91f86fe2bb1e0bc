"""The noise-free experiment with a chain of agents: who is held back by the speed limit, and who recovers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from controllers.chain import ChainTrajectory
from formation.angles import FloatArray
from formation.closed_loop import IntegrationError
from formation.station import Station
from hil.errors import CheckFailedError, UsageError
from hil.figures.chain_figures import draw_chain
from hil.scenario import parts as scenario_parts
from hil.scenario.schema import Scenario
from hil.track_table import write_tracks

SAMPLE_STEP = 0.01
MOST_CELLS = 20_000_000
"""Numbers that a run may keep: longer runs of longer chains are sampled more coarsely."""
SETTLED_RHO, SETTLED_ANGLE = 0.02, math.pi / 180.0
"""A pair has settled once its distance stays within this share and its bearings within this angle [rad]."""

_ROUNDING = 1e-6
# A picture shows the motion until all have settled and a little more.
_SHOWN_AFTER, _SHOWN_AT_LEAST = 1.3, 0.25


def simulate_chain_of(scenario: Scenario, agents: int, out: Path | None) -> dict[str, object]:
    """Run a chain of ``agents`` on the exact shape dynamics and report on each pair; ``out`` takes files.

    ``pairs``, one for each follower: ``rho_final``; ``settle_s``, from when on the pair keeps its station
    (:data:`SETTLED_RHO`, :data:`SETTLED_ANGLE`), absent if it doesn't by the end; ``v_peak`` of the follower
    within its limit and ``v_wanted_peak`` that the law asked for; ``saturated_from_s``, when it first asked
    for more than the limit, absent if it never did; ``rho_min``, ``rho_max``. ``recovered``: whether all
    pairs have settled. Files: ``trajectory.csv`` and ``chain.png``, laid out like the paper's figure of a
    chain. Raises :class:`CheckFailedError` if the motion breaks down.
    """
    duration = scenario.run.duration_s
    step = max(SAMPLE_STEP, duration * 12 * agents / MOST_CELLS)
    times = np.linspace(0.0, duration, max(2, round(duration / step) + 1))
    try:
        trajectory = scenario_parts.chain_run(scenario, agents, times)
    except IntegrationError as error:
        raise CheckFailedError(f"scenario {scenario.name}: {error}; check gains and start poses") from error
    settled = settling_times(trajectory, scenario.formation.rho_0, scenario_parts.gains(scenario).station)
    if out is not None:
        _write(scenario, trajectory, settled, out)
    pairs = [_pair(trajectory, k, settled[k], scenario.controller.v_max) for k in range(agents - 1)]
    return {"agents": agents, "recovered": all(moment is not None for moment in settled), "pairs": pairs}


def settling_times(trajectory: ChainTrajectory, rho_0: float, station: Station) -> list[float | None]:
    """For each pair the time [s] from which on it keeps its station to the end, None if it doesn't."""
    away = np.abs(trajectory.rho / rho_0 - 1.0) > SETTLED_RHO
    for angle, desired in ((trajectory.alpha1, station.alpha1), (trajectory.alpha2, station.alpha2)):
        away |= np.cos(angle - desired) < math.cos(SETTLED_ANGLE)
    found: list[float | None] = []
    for pair in range(away.shape[1]):
        rows = np.flatnonzero(away[:, pair])
        after = int(rows[-1]) + 1 if len(rows) else 0
        found.append(float(trajectory.t[after]) if after < len(trajectory.t) else None)
    return found


def _pair(
    trajectory: ChainTrajectory, pair: int, settled: float | None, v_max: float
) -> dict[str, float | None]:
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


def _write(scenario: Scenario, trajectory: ChainTrajectory, settled: list[float | None], out: Path) -> None:
    last = max((math.inf if moment is None else moment for moment in settled), default=0.0)
    until = max(_SHOWN_AFTER * last, _SHOWN_AT_LEAST * float(trajectory.t[-1]))
    try:
        out.mkdir(parents=True, exist_ok=True)
        agents = (trajectory.poses, trajectory.v, trajectory.u)
        write_tracks(out / "trajectory.csv", trajectory.t, *agents, _shapes(trajectory))
        draw_chain(scenario, trajectory, until, out / "chain.png")
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror}); choose another --out") from error


def _shapes(trajectory: ChainTrajectory) -> dict[str, FloatArray]:
    """Columns of the pairs' shapes; agents count from 1, as pairs do."""
    columns = {"rho": trajectory.rho, "alpha1": trajectory.alpha1, "alpha2": trajectory.alpha2}
    return {
        f"{name}_{pair + 1}_{pair + 2}": values[:, pair]
        for pair in range(trajectory.rho.shape[1])
        for name, values in columns.items()
    }
