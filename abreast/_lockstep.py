"""Whole runs on a simulated clock."""

from __future__ import annotations

import os
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from abreast._runs import Run, run_of
from abreast._scenarios import Own, ScenarioLike, scenario_of, text_of
from formation.collector import collector_paused
from hil.errors import UsageError
from hil.judge.chain_summary import summarise_chain
from hil.judge.made_by import law_failure
from hil.judge.run_data import RunData, run_data_of_link, run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.run import timed_lockstep
from hil.log.metadata import scenario_of as scenario_in
from hil.log.reader import Log, read_log
from hil.scenario.files import refuse_unrunnable
from hil.scenario.links import chain_of, links_of
from hil.scenario.schema import Scenario


def run_lockstep(
    scenario: ScenarioLike = "turtlebot3",
    *,
    seed: int | None = None,
    law: Own | None = None,
    estimator: Own | None = None,
    log: str | os.PathLike[str] | None = None,
) -> Run:
    """Drive a scenario through the whole loop in lockstep, as ``abreast run --lockstep`` does, and judge it.

    The same seed gives the same bytes. ``seed``, ``law``, ``estimator``: in place of the scenario's. A law
    ``law(shape, leader, gains) -> (v2, u2)`` or a factory ``estimator(model) -> Estimator`` of your own is a
    function or ``file.py:name``; one that fails stops the robot, with a warning that says why.
    ``log``: a new file for the MCAP log; without it none is kept, and the summary tells of none. Raises
    :class:`UsageError` for what cannot be run, and :class:`CheckFailedError` if the leader never sets off.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 4.0})
    >>> run = abreast.run_lockstep(scenario, seed=7, estimator="ukf")
    >>> run.summary["estimator"], run.summary["seed"], len(run.commands.t) > 0
    ('ukf', 7, True)

    >>> def straight_ahead(shape, leader, gains):
    ...     return leader.v1, -gains.mu2 * shape.cos2
    >>> abreast.run_lockstep(scenario, law=straight_ahead).summary["law"]["name"]
    'program:straight_ahead'
    """
    changes = {"run.seed": seed, "controller.law": text_of(law), "estimator.kind": text_of(estimator)}
    chosen = scenario_of(scenario, changes)
    refuse_unrunnable(chosen)
    links_of(chosen)
    if log is not None:
        return _driven(chosen, _free(Path(log)), kept=True)
    with tempfile.TemporaryDirectory(prefix="abreast-") as folder:
        return _driven(chosen, Path(folder) / "run.mcap", kept=False)


def _free(path: Path) -> Path:
    if path.exists():
        raise UsageError(f"{path} exists already; give another log, or move it away")
    return path


@collector_paused()
def _driven(scenario: Scenario, path: Path, *, kept: bool) -> Run:
    timing = timed_lockstep(scenario, path)
    summary, runs = _judged(read_log(path), kept=kept)
    if failure := law_failure(summary):
        warnings.warn(failure, RuntimeWarning, stacklevel=4)
    return run_of(summary | {"lockstep": timing}, runs)


def _judged(log: Log, *, kept: bool) -> tuple[dict[str, Any], list[RunData]]:
    own = scenario_in(log)
    if own is not None and chain_of(own) is not None:
        runs = [_of(run_data_of_link(log, link), kept=kept) for link in links_of(own)]
        return summarise_chain(own, runs), runs
    run_data = _of(run_data_of_log(log), kept=kept)
    return summarise(run_data), [run_data]


def _of(run_data: RunData, *, kept: bool) -> RunData:
    """The data of a run, which do not tell of a log that will be gone."""
    return run_data if kept else replace(run_data, log=None)
