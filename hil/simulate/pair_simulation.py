"""The noise-free experiments of the paper: a pair under a law, no wire, no estimator, no speed limits."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from formation.angles import FloatArray
from formation.closed_loop import IntegrationError, Trajectory
from formation.periodic_orbit import PeriodicOrbit, find_orbit
from formation.spacing import lyapunov
from hil.errors import CheckFailedError, UsageError
from hil.extensions.reference import is_reference
from hil.extras import left_out_if_missing
from hil.judge.stability import PROVED_V1, Stability, stability_json, stability_of
from hil.log.written_aside import written_aside
from hil.scenario import parts as scenario_parts
from hil.scenario.noise_free_runs import follower_law, noise_free_run
from hil.scenario.ordered_sides import refusal
from hil.scenario.schema import Scenario
from hil.scenario.travel import as_travelled
from hil.simulate.simulation import Simulation

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind

SAMPLE_STEP = 0.005
MOST_SAMPLES = 200_000

_COLUMNS = ("t", "rho", "alpha1", "alpha2", "v1", "u1", "v2", "u2")
_POSE_COLUMNS = ("x", "y", "theta")


def simulate(
    scenario: Scenario, out: Path | None, *, stability: bool = False, figures: Kind | None = None
) -> Simulation:
    """Run the scenario's law on the exact shape dynamics and report on it; with ``out``, write files there.

    The report is the JSON of ``abreast simulate``: ``final`` shape; ``orbit`` of the reduced system, absent
    if the leader's program has no period or no orbit was found; ``extremes`` of the follower's motion over
    the whole run; ``V1_initial`` and whether it lies in the region of attraction that Prop. 1 proves (the
    true region is larger). ``orbit.floquet`` is the largest modulus of the Floquet multipliers. The motion is
    not limited, as in the proofs.

    With orders to change sides it is limited, and they are treated as by the controller daemon;
    ``orders_refused`` says why, if they are refused.

    With ``stability``, ``stability`` too: the propositions checked by :mod:`hil.judge.stability`, and its
    picture.

    Files: ``trajectory.csv`` and the pictures ``simulation.png`` (laid out like the paper's Fig. 2) and
    ``experiment.png`` (like its Fig. 3). Raises :class:`CheckFailedError` if the motion breaks down.
    """
    scenario = as_travelled(scenario)
    try:
        trajectory = noise_free_run(scenario, _sample_times(scenario.run.duration_s))
    except IntegrationError as error:
        raise CheckFailedError(f"scenario {scenario.name}: {error}; check gains and start poses") from error
    program, law = scenario_parts.leader_program(scenario), follower_law(scenario)
    changes = scenario.formation.change_sides_at_s
    orbit = (
        None
        if changes
        else find_orbit(program, law, scenario.formation.rho_0, scenario_parts.station(scenario))
    )
    report = _report(scenario, trajectory, orbit)
    if (why := refusal(scenario)) is not None:
        report["orders_refused"] = why
    if out is not None:
        _write(scenario, trajectory, orbit, out, figures)
    if stability:
        found = stability_of(scenario, trajectory)
        report["stability"] = stability_json(found)
        if out is not None:
            _write_stability(scenario, found, out, figures)
    return Simulation(
        report,
        t=trajectory.t,
        poses=np.stack([trajectory.leader, trajectory.follower], axis=1),
        v=np.column_stack([trajectory.v1, trajectory.v2]),
        u=np.column_stack([trajectory.u1, trajectory.u2]),
        rho=trajectory.rho,
        alpha1=trajectory.alpha1,
        alpha2=trajectory.alpha2,
    )


def _sample_times(duration: float) -> FloatArray:
    step = max(SAMPLE_STEP, duration / MOST_SAMPLES)
    return np.linspace(0.0, duration, max(2, round(duration / step) + 1))


def _report(scenario: Scenario, trajectory: Trajectory, orbit: PeriodicOrbit | None) -> dict[str, object]:
    start, final = trajectory.shape_at(0), trajectory.shape_at(-1)
    V1_initial = lyapunov(start, scenario_parts.gains(scenario).spacing, scenario_parts.station(scenario))
    report: dict[str, object] = {
        "final": {"rho": final.rho, "alpha1": final.alpha1, "alpha2": final.alpha2},
    }
    if orbit is not None:
        report["orbit"] = {
            "period_s": orbit.period,
            **_range("rho", orbit.rho),
            **_range("alpha1", orbit.alpha1),
            **_range("v2", orbit.v2),
            "floquet": orbit.largest_multiplier,
        }
    report["extremes"] = {"v2": _extremes(trajectory.v2), "u2": _extremes(trajectory.u2)}
    report["V1_initial"] = V1_initial
    if not is_reference(scenario.controller.law):
        report["in_region_of_attraction"] = V1_initial < PROVED_V1
    return report


def _range(name: str, values: FloatArray) -> dict[str, float]:
    return {f"{name}_min": float(values.min()), f"{name}_max": float(values.max())}


def _extremes(values: FloatArray) -> list[float]:
    return [float(values.min()), float(values.max())]


def _write(
    scenario: Scenario,
    trajectory: Trajectory,
    orbit: PeriodicOrbit | None,
    out: Path,
    figures: Kind | None,
) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        _write_csv(trajectory, out / "trajectory.csv")
        with left_out_if_missing("simulation.png and no experiment.png"):
            from hil.figures.paper_figures import write_paper_figures
            from hil.figures.simulation_figures import (
                draw_experiment,
                draw_simulation,
                simulation_paper_figures,
            )

            draw_simulation(scenario, trajectory, orbit, out / "simulation.png")
            draw_experiment(scenario, trajectory, out / "experiment.png")
            if figures:
                single = simulation_paper_figures(scenario, trajectory, orbit)
                write_paper_figures(single, out / "figures", figures)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror}); choose another --out") from error


def _write_stability(scenario: Scenario, found: Stability, out: Path, figures: Kind | None) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        with left_out_if_missing("stability.png"):
            from hil.figures.paper_figures import write_paper_figures
            from hil.figures.stability_figures import draw_stability, stability_paper_figures

            draw_stability(scenario, found, out / "stability.png")
            if figures:
                write_paper_figures(stability_paper_figures(scenario, found), out / "figures", figures)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror}); choose another --out") from error


def _write_csv(trajectory: Trajectory, path: Path) -> None:
    """One row per sample: shape, motions of both, poses of both. Floats as Python repeats them exactly."""
    header = [*_COLUMNS, *(f"leader_{c}" for c in _POSE_COLUMNS), *(f"follower_{c}" for c in _POSE_COLUMNS)]
    columns = [getattr(trajectory, name) for name in _COLUMNS]
    table = np.column_stack([*columns, trajectory.leader, trajectory.follower])
    with written_aside(path) as aside, aside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(table.tolist())
