"""The noise-free experiment with a chain of agents: who is held back by the speed limit, and who recovers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controllers.chain import ChainTrajectory
from formation.angles import FloatArray
from formation.closed_loop import IntegrationError
from hil.errors import CheckFailedError, UsageError
from hil.extras import left_out_if_missing
from hil.judge.chain_pairs import EXACTLY, pair_figures, settling_times
from hil.scenario import parts as scenario_parts
from hil.scenario.noise_free_runs import chain_run
from hil.scenario.schema import Scenario
from hil.scenario.travel import as_travelled
from hil.simulate.simulation import Simulation
from hil.simulate.track_table import write_tracks

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind

SAMPLE_STEP = 0.01
MOST_CELLS = 20_000_000
"""Numbers that a run may keep: longer runs of longer chains are sampled more coarsely."""
# A picture shows the motion until all have settled and a little more.
_SHOWN_AFTER, _SHOWN_AT_LEAST = 1.3, 0.25


def simulate_chain_of(
    scenario: Scenario, agents: int, out: Path | None, figures: Kind | None = None
) -> Simulation:
    """Run a chain of ``agents`` on the exact shape dynamics and report on each pair; ``out`` takes files.

    ``pairs``, one for each follower: ``settle_s``, from when on the pair keeps its station
    (:data:`~hil.judge.chain_pairs.EXACTLY`), absent if it doesn't by the end, and what else
    :func:`hil.judge.chain_pairs.pair_figures` tells. ``recovered``: whether all pairs have settled. Files:
    ``trajectory.csv`` and ``chain.png``, laid out like the paper's figure of a chain. Raises
    :class:`CheckFailedError` if the motion breaks down.
    """
    scenario = as_travelled(scenario)
    duration = scenario.run.duration_s
    step = max(SAMPLE_STEP, duration * 12 * agents / MOST_CELLS)
    times = np.linspace(0.0, duration, max(2, round(duration / step) + 1))
    try:
        trajectory = chain_run(scenario, agents, times)
    except IntegrationError as error:
        raise CheckFailedError(f"scenario {scenario.name}: {error}; check gains and start poses") from error
    settled = settling_times(trajectory, scenario.formation.rho_0, scenario_parts.station(scenario), EXACTLY)
    if out is not None:
        _write(scenario, trajectory, settled, out, figures)
    pairs = [pair_figures(trajectory, k, settled[k], scenario.controller.v_max) for k in range(agents - 1)]
    recovered = all(moment is not None for moment in settled)
    return Simulation(
        {"agents": agents, "recovered": recovered, "pairs": pairs},
        t=trajectory.t,
        poses=trajectory.poses,
        v=trajectory.v,
        u=trajectory.u,
        rho=trajectory.rho,
        alpha1=trajectory.alpha1,
        alpha2=trajectory.alpha2,
    )


def _write(
    scenario: Scenario,
    trajectory: ChainTrajectory,
    settled: list[float | None],
    out: Path,
    figures: Kind | None,
) -> None:
    last = max((math.inf if moment is None else moment for moment in settled), default=0.0)
    until = max(_SHOWN_AFTER * last, _SHOWN_AT_LEAST * float(trajectory.t[-1]))
    try:
        out.mkdir(parents=True, exist_ok=True)
        agents = (trajectory.poses, trajectory.v, trajectory.u)
        write_tracks(out / "trajectory.csv", trajectory.t, *agents, _shapes(trajectory))
        with left_out_if_missing("chain.png"):
            from hil.figures.chain_figures import chain_paper_figures, draw_chain
            from hil.figures.paper_figures import write_paper_figures

            draw_chain(scenario, trajectory, until, out / "chain.png")
            if figures:
                single = chain_paper_figures(scenario, trajectory, until)
                write_paper_figures(single, out / "figures", figures)
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
