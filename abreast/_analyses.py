"""What can be told of a scenario without noise, of many runs, and of a lab."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from abreast._logs import LogLike, log_of
from abreast._scenarios import Own, ScenarioLike, scenario_of, text_of
from estimation.bounds.certificate import Certificate
from formation.angles import FloatArray
from hil.errors import UsageError
from hil.log.report_json import flat
from hil.replay.lab_calibration import Calibration, calibration_of
from hil.scenario.certificate import certificate_of
from hil.scenario.files import Overrides, override_texts
from hil.simulate.experiments import experiment
from hil.simulate.gain_proposal import GainProposal, propose
from hil.simulate.simulation import Simulation
from hil.sweep.results import fly_sweep, write_results
from hil.sweep.spec import load_sweep


def simulate(
    scenario: ScenarioLike = "turtlebot3",
    *,
    law: Own | None = None,
    duration_s: float | None = None,
    stability: bool = False,
    out: str | os.PathLike[str] | None = None,
) -> Simulation:
    """Integrate a scenario without noise or delay, as the paper does: ``abreast simulate``.

    ``law``, ``duration_s``: in place of the scenario's. ``stability``: check the propositions of the paper
    too, of a pair. ``out``: a folder for pictures and CSV. Raises :class:`UsageError` for a scenario that
    does not allow it, :class:`CheckFailedError` if the motion breaks down.

    >>> import abreast
    >>> found = abreast.simulate("turtlebot3", law="ideal")
    >>> print(f"{found.rho[0]:.3f} m to {found.rho[-1]:.3f} m")
    0.832 m to 0.200 m
    """
    changes = {"controller.law": text_of(law), "run.duration_s": duration_s}
    folder = None if out is None else Path(out)
    return experiment(scenario_of(scenario, changes), folder, stability=stability)


def bounds(scenario: ScenarioLike = "turtlebot3") -> Certificate:
    """What is guaranteed of estimates and formation before anything drives: ``abreast bounds``.

    >>> import abreast
    >>> kept = abreast.bounds("turtlebot3").formation.figures
    >>> print(f"{kept['rho_min']:.3f} to {kept['rho_max']:.3f} m")
    0.157 to 0.267 m
    """
    return certificate_of(scenario_of(scenario))


def gains(scenario: ScenarioLike = "turtlebot3") -> GainProposal:
    """Gains for a scenario's robots, leader, delays and noise, with what bounds each: ``abreast gains``.

    >>> import abreast
    >>> slow = abreast.load_scenario("turtlebot3", {"mocap.latency_s": 3.0})
    >>> found = abreast.gains(slow)
    >>> print(found.gains, "mu1 needs" in found.why)
    None True
    """
    return propose(scenario_of(scenario))


def calibrate(
    log: LogLike, *, follower: str | None = None, from_s: float | None = None, to_s: float | None = None
) -> Calibration:
    """What a log tells of the lab that it was made in: ``abreast calibrate``.

    ``follower``: whose, in a chain. ``from_s``, ``to_s`` [s]: the span to look at, since the first sighting
    or odometry, of imported recordings in the source's own time. Raises :class:`UsageError` for a log that is
    not abreast's or tells nothing.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 12.0, "mocap.clock_offset_s": 0.03})
    >>> run = abreast.run_lockstep(scenario, log="late.mcap")
    >>> found = abreast.calibrate("late.mcap")
    >>> print(f"{found.timing['stamp_offset_s'].value:.2f} s")
    0.03 s
    """
    return calibration_of(log_of(log), follower, from_s, to_s)


@dataclass(frozen=True, slots=True, eq=False)
class SweepResult:
    """What a sweep found: ``cells``, each as in the JSON, and how long it took.

    ``run_seconds``: of runs, ``wall_s`` of waiting, both in this call.

    >>> import abreast
    >>> grid = {"sigma_position": [3e-4, 3e-3], "sigma_heading": [3.5e-3]}
    >>> found = abreast.sweep({"grid": grid}, runs=2, duration_s=4.0)
    >>> worse = found.column("rmse.v1")
    >>> worse.shape, bool(worse[1] > worse[0])
    ((2,), True)
    """

    cells: Sequence[Mapping[str, Any]]
    run_seconds: float
    wall_s: float

    def as_dict(self) -> dict[str, Any]:
        """The JSON of ``abreast sweep``."""
        return {"cells": list(self.cells), "run_seconds": self.run_seconds, "wall_s": self.wall_s}

    def column(self, name: str) -> FloatArray:
        """A figure of every cell, such as ``rmse.v1`` or ``loss``: (cells,), NaN where it has none."""
        return np.array([dict(flat(cell)).get(name, math.nan) for cell in self.cells], dtype=np.float64)


def sweep(
    spec: str | os.PathLike[str] | Mapping[str, Any] = "default",
    *,
    runs: int | None = None,
    seed: int | None = None,
    duration_s: float | None = None,
    estimators: Sequence[Own] | None = None,
    law: Own | None = None,
    overrides: Overrides = (),
    workers: int = 1,
    scheduler: str | None = None,
    out: str | os.PathLike[str] | None = None,
) -> SweepResult:
    """Fly many runs of every cell of a grid over noise, latency and loss: ``abreast sweep``.

    ``spec``: a shipped name, a TOML file, or what would stand in one. ``runs``, ``seed``, ``duration_s``,
    ``estimators`` are in place of its own, ``law`` and ``overrides`` (values by ``section.key``) in place of
    the scenario's, in all cells. ``workers``: processes; more than one needs a main module that may be
    imported again. ``scheduler``: a Dask address instead. ``out``: a folder for tables and report, in which
    an interrupted sweep goes on. Raises :class:`UsageError` for whatever is wrong in it.

    >>> import abreast
    >>> grid = {"sigma_position": [3e-4], "sigma_heading": [3.5e-3], "loss": [0.0, 0.2]}
    >>> found = abreast.sweep({"grid": grid}, runs=2, duration_s=4.0, estimators=["ekf", "ukf"])
    >>> [(cell["loss"], cell["estimator"]) for cell in found.cells]
    [(0.0, 'ekf'), (0.0, 'ukf'), (0.2, 'ekf'), (0.2, 'ukf')]
    """
    texts = [*override_texts(overrides), *([] if law is None else [f"controller.law={text_of(law)}"])]
    kinds = None if estimators is None else [text_of(each) for each in estimators]
    if workers < 1:
        raise UsageError(f"workers is {workers}, expected a number of processes from 1 up")
    if workers > 1 or scheduler is not None:
        _refuse_at_hand([text_of(law), *(kinds or [])])
    given = spec if isinstance(spec, Mapping) else os.fspath(spec)
    chosen = load_sweep(given, texts, runs=runs, seed=seed, duration_s=duration_s, estimators=kinds)
    if out is None:
        with tempfile.TemporaryDirectory(prefix="abreast-") as folder:
            result = fly_sweep(chosen, Path(folder), workers=workers, scheduler=scheduler, progress=_quiet)
    else:
        result = fly_sweep(chosen, Path(out), workers=workers, scheduler=scheduler, progress=_quiet)
        write_results(chosen, result, Path(out))
    return SweepResult(**result)


def _refuse_at_hand(texts: Sequence[str | None]) -> None:
    """Other processes have nothing of what this program alone has at hand."""
    for text in texts:
        if text is not None and text.startswith("program:"):
            raise UsageError(
                f"{text.partition(':')[2]} is at hand in this program only; put it into a file for the "
                "workers to load, or leave workers and scheduler out"
            )


def _quiet(done: int) -> None:
    """Say nothing of how far a sweep is."""
