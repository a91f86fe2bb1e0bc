"""``abreast stop``: stop all robots of a lab, and see that they are told so and stand."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.wire_options import endpoints_of, wire_options
from hil.errors import AbreastError
from hil.log.report_json import note, say

if TYPE_CHECKING:
    from hil.live.runs_here import RunHere
    from hil.live.stopping import Stopped
    from hil.scenario.schema import Scenario
    from hil.wire.session import Endpoints

_PATIENCE_S, _GLANCE_S = 3.0, 1.0
_OTHERS = "; are these not your robots, give --scenario FILE of your lab, and see that its bridge runs"


@click.command("stop", params=wire_options(listens=False))
@click.argument("reason", default="stopped by hand")
@click.option("--scenario", default="turtlebot3", show_default=True, help="Whose robots: a name or a file.")
def command(
    reason: str,
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Stop everybody for REASON: controllers by a stop message, and robots by a command to stand.

    Without --connect it stops every run of yours on this machine as well, and says which. Ends with 0 once
    all robots are told to stand, are heard of, nobody tells one otherwise, and none moves on by its odometry,
    else with 1.
    """
    from hil.scenario.files import load_scenario

    chosen = load_scenario(scenario, overrides)
    endpoints = endpoints_of(connect, None, zenoh_config, secure, "operator")
    if connect or zenoh_config:
        done = _tell(_stopped(endpoints, chosen, reason))
    else:
        done = _stop_here(endpoints, chosen, secure, reason)
    if not done:
        sys.exit(1)


def _stopped(endpoints: Endpoints, scenario: Scenario, reason: str, patience: float = _PATIENCE_S) -> Stopped:
    from hil.live.stopping import stop_all
    from hil.wire.pubsub import joined

    with joined(endpoints, scenario, "stop", patience=patience) as wire:
        return stop_all(wire, scenario, reason)


def _tell(stopped: Stopped, whose: str = "") -> bool:
    """Say what came of a stop, and give whether it is done."""
    if stopped.done:
        say(f"{whose}{stopped.line()}")
    else:
        note(f"abreast stop: {whose}{stopped.line()}{_OTHERS if stopped.unheard else ''}")
    return stopped.done


def _stop_here(usual: Endpoints, scenario: Scenario, secure: Path | None, reason: str) -> bool:
    """Stop the lab at the usual endpoint and all runs of this machine, all at once; whether that is done."""
    from concurrent.futures import ThreadPoolExecutor, as_completed

    from hil.commands.found_runs import answers, needs_keys, scenario_was_given
    from hil.live.runs_here import own_folder, runs_here
    from hil.wire.session import NoRouterError

    runs = runs_here(own_folder())
    if not runs:
        try:
            return _tell(_stopped(usual, scenario, reason))
        except NoRouterError as error:
            text = f"{error}; no run of yours goes on here: give --connect ENDPOINT of your lab"
            raise NoRouterError(text) from None
    somebody = answers(usual)
    with ThreadPoolExecutor(len(runs) + 1) as pool:
        stops = {
            pool.submit(_stopped_run, run, scenario, secure, reason): f"run of {run.scenario}: "
            for run in runs
            if not needs_keys(run, secure)
        }
        lab = None
        known = any(run.endpoint == usual.connect for run in runs) and not scenario_was_given()
        if not known:
            patience = _PATIENCE_S if somebody else _GLANCE_S
            lab = pool.submit(_stopped, usual, scenario, reason, patience)
            stops[lab] = f"{usual.describe()}: "
        done = True
        for stop in as_completed(stops):
            whose = stops[stop]
            try:
                done = _tell(stop.result(), whose) and done
            except Exception as error:  # whatever comes of one, what came of the others is told
                nobody = stop is lab and not somebody and isinstance(error, NoRouterError)
                told = f"no other lab is at {usual.describe()}" if nobody else f"{whose}{error}"
                note(f"abreast stop: {told}")
                done = done and nobody
    for run in runs:
        if needs_keys(run, secure):
            note(f"abreast stop: run of {run.scenario}: not stopped, it has keys: give {run.options}")
            done = False
    return done


def _stopped_run(run: RunHere, scenario: Scenario, secure: Path | None, reason: str) -> Stopped:
    """Stop a run by its own scenario, or where that is gone by another."""
    from hil.commands.found_runs import endpoints_of_run
    from hil.scenario.files import load_scenario

    try:
        scenario = load_scenario(run.scenario)
    except AbreastError as error:
        note(f"abreast stop: {error}; robots are told by the names of {scenario.name}")
    return _stopped(endpoints_of_run(run, secure, "operator"), scenario, reason)
