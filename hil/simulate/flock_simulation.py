"""The noise-free experiment with a flock: whether all gather in their places, and what a turn does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controllers.flock import Choice, FlockTrajectory, simulate_flock
from formation.angles import FloatArray, wrap
from formation.closed_loop import IntegrationError
from formation.flock_places import skein
from formation.pose import Pose
from hil.errors import CheckFailedError, UsageError
from hil.extras import left_out_if_missing
from hil.judge.chain_pairs import EXACTLY
from hil.scenario import parts as scenario_parts
from hil.scenario.schema import FlockSection, Scenario
from hil.scenario.travel import as_travelled
from hil.simulate.simulation import Simulation
from hil.simulate.track_table import write_tracks

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind

_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class FlockRun:
    """Places (N, 2), the run, distances ``off`` (n, N) [m] from the places, and each agent's file (N,)."""

    places: FloatArray
    trajectory: FlockTrajectory
    off: FloatArray
    files: NDArray[np.int64]


def simulate_flock_of(
    scenario: Scenario, flock: FlockSection, out: Path | None, figures: Kind | None = None
) -> Simulation:
    """Run a flock and report on it; with ``out``, write ``trajectory.csv`` and ``flock.png`` there.

    ``gathered_s``: when for the first time all agents are in their places (off by at most the share of
    the spacing, and by the angle from the leader's heading, of :data:`~hil.judge.chain_pairs.EXACTLY`),
    and ``settle_s``, from when on they stay there to the end; absent if they don't. ``displacement_max``,
    ``displacement_final`` [m]: largest distance of an agent from its place, in the frame that turns with
    the leader. ``clearance_min``: least distance between any two agents. ``reach_max``: longest distance
    at which a neighbour was followed. ``changes``: how often an agent changed its neighbours,
    ``last_change_s`` when last. ``saturated_share``: part of the time in which the law asked for more
    than the limit, mean over the followers. ``files``, from the leader outwards: their largest
    displacement and the peaks of speed and turn rate.

    Raises :class:`CheckFailedError` if the motion breaks down.
    """
    scenario = as_travelled(scenario)
    try:
        places, trajectory = _flown(scenario, flock)
    except IntegrationError as error:
        raise CheckFailedError(f"scenario {scenario.name}: {error}; check gains and scatter") from error
    off = np.linalg.norm(trajectory.displacements(places), axis=2)
    distances = np.abs(places[:, 1]) / (scenario.formation.rho_0 * math.sqrt(0.75))
    run = FlockRun(places, trajectory, off, np.rint(distances).astype(np.int64))
    if out is not None:
        _write(scenario, run, out, figures)
    return Simulation(_report(scenario, run), trajectory.t, trajectory.poses, trajectory.v, trajectory.u)


def _flown(scenario: Scenario, flock: FlockSection) -> tuple[FloatArray, FlockTrajectory]:
    """Places (N, 2) in the leader's frame, and the trajectory."""
    try:
        places = skein(flock.agents, scenario.formation.rho_0)
        return places, simulate_flock(
            scattered(places, Pose(*scenario.leader.pose), flock, scenario.run.seed),
            places,
            scenario_parts.leader_program(scenario),
            scenario_parts.law_gains(scenario),
            scenario_parts.limits(scenario),
            Choice(flock.neighbours, flock.choose_every_s, flock.least_bearing),
            scenario.run.duration_s,
            knows_turn=scenario_parts.knows_turn(scenario),
        )
    except ValueError as error:
        raise UsageError(f"scenario {scenario.name}: {error}; correct [flock] or run.duration_s") from None


def scattered(places: FloatArray, leader: Pose, flock: FlockSection, seed: int) -> FloatArray:
    """Poses (N, 3) in the world frame: the places, the followers off theirs at random."""
    off = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(places), 3))
    off *= (flock.scatter, flock.scatter, flock.scatter_heading)
    off[0] = 0.0
    x, y = (places + off[:, :2]).T
    cos, sin = math.cos(leader.theta), math.sin(leader.theta)
    world = (leader.x + cos * x - sin * y, leader.y + sin * x + cos * y, leader.theta + off[:, 2])
    return np.column_stack(world)


def _report(scenario: Scenario, run: FlockRun) -> dict[str, object]:
    trajectory = run.trajectory
    t, wanted = trajectory.t, np.abs(trajectory.wanted[:, 1:])
    settled = _settled(run, scenario.formation.rho_0)
    gathered, away = np.flatnonzero(settled), np.flatnonzero(~settled)
    after = int(away[-1]) + 1 if len(away) else 0
    changed = _changed(trajectory)
    when = np.flatnonzero(changed.any(axis=1))
    return {
        "agents": len(run.places),
        "gathered_s": float(t[gathered[0]]) if len(gathered) else None,
        "settle_s": float(t[after]) if after < len(t) else None,
        "displacement_max": float(run.off.max()),
        "displacement_final": float(run.off[-1].max()),
        "clearance_min": float(trajectory.clearance.min()),
        "reach_max": _reach(trajectory),
        "changes": int(changed.sum()),
        "last_change_s": float(t[when[-1] + 1]) if len(when) else None,
        "saturated_share": float((wanted > scenario.controller.v_max * (1.0 + _ROUNDING)).mean()),
        "files": [_file(run, number) for number in range(1, int(run.files.max()) + 1)],
    }


def _settled(run: FlockRun, spacing: float) -> NDArray[np.bool_]:
    """Whether all are in their places, at each sample."""
    theta = run.trajectory.poses[:, :, 2]
    turned = np.abs(wrap(theta - theta[:, :1]))
    return np.asarray(((run.off <= EXACTLY.share * spacing) & (turned <= EXACTLY.angle)).all(axis=1))


def _changed(trajectory: FlockTrajectory) -> NDArray[np.bool_]:
    """Whether an agent follows others than at the sample before, (n-1, N); their order doesn't matter."""
    chosen = np.sort(trajectory.neighbours, axis=2)
    return np.asarray((chosen[1:] != chosen[:-1]).any(axis=2))


def _reach(trajectory: FlockTrajectory) -> float:
    furthest = 0.0
    for poses, chosen in zip(trajectory.poses, trajectory.neighbours, strict=True):
        apart = poses[chosen, :2] - poses[:, np.newaxis, :2]
        furthest = max(furthest, float(np.linalg.norm(apart, axis=2)[chosen >= 0].max()))
    return furthest


def _file(run: FlockRun, number: int) -> dict[str, float]:
    agents = np.flatnonzero(run.files == number)
    return {
        "displacement_max": float(run.off[:, agents].max()),
        "v_peak": float(np.abs(run.trajectory.v[:, agents]).max()),
        "u_peak": float(np.abs(run.trajectory.u[:, agents]).max()),
    }


def _write(scenario: Scenario, run: FlockRun, out: Path, figures: Kind | None) -> None:
    trajectory = run.trajectory
    further = {f"off_{agent + 1}": run.off[:, agent] for agent in range(1, len(run.places))}
    try:
        out.mkdir(parents=True, exist_ok=True)
        agents = (trajectory.poses, trajectory.v, trajectory.u)
        write_tracks(out / "trajectory.csv", trajectory.t, *agents, further)
        with left_out_if_missing("flock.png"):
            from hil.figures.flock_figures import draw_flock, flock_paper_figures
            from hil.figures.paper_figures import write_paper_figures

            draw_flock(scenario, trajectory, run.off, run.files, out / "flock.png")
            if figures:
                single = flock_paper_figures(scenario, trajectory, run.off, run.files)
                write_paper_figures(single, out / "figures", figures)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror}); choose another --out") from error
