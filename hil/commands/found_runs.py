"""Which lab a command is for that was not told where: the usual endpoint, and runs of this machine."""

from __future__ import annotations

import shlex
import socket
from pathlib import Path
from typing import NamedTuple

import click
from click.core import ParameterSource

from hil.commands.wire_options import endpoints_of
from hil.errors import CheckFailedError
from hil.live.runs_here import RunHere, own_folder, runs_here
from hil.log.report_json import note
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.key_layout import layout_of
from hil.wire.lab_robots import robots_of
from hil.wire.session import Endpoints

USUAL = "turtlebot3"
"""The scenario of commands that are told none."""

_GLANCE_S = 0.3


class Lab(NamedTuple):
    """Where to join, by which scenario, a name or a file; and whether it is a run of this machine."""

    endpoints: Endpoints
    scenario: str
    is_run: bool = False


def lab_or_run(
    connect: str | None, zenoh_config: Path | None, secure: Path | None, role: str, scenario: str
) -> Lab:
    """The lab that was given; else the usual endpoint, or where nobody is there the one run of this machine.

    Says which run it is. Raises :class:`CheckFailedError` where there are several, with what to give.
    """
    endpoints = endpoints_of(connect, None, zenoh_config, secure, role)
    runs = [] if connect or zenoh_config else runs_here(own_folder())
    there = [run for run in runs if run.endpoint == endpoints.connect]
    if not runs or not (there or not answers(endpoints)):
        return Lab(endpoints, scenario)
    run, *others = there or runs
    if others and not there:
        told = "; ".join(f"{each.options} (pid {each.pid}, {each.scenario})" for each in runs)
        raise CheckFailedError(
            f"nobody is at {endpoints.describe()}, and {len(runs)} runs go on here: give {told}"
        )
    note(f"the run of {run.scenario} goes on here: {run.options}")
    if needs_keys(run, secure):
        raise CheckFailedError(
            f"the run at {run.endpoint} has keys: give --secure DIR, the folder of its keys"
        )
    return Lab(endpoints_of_run(run, secure, role), scenario if scenario_was_given() else run.scenario, True)


def needs_keys(run: RunHere, secure: Path | None) -> bool:
    """Whether a run has keys, and none were given."""
    return run.has_keys and secure is None


def endpoints_of_run(run: RunHere, secure: Path | None, role: str) -> Endpoints:
    """Where a run is joined, by keys where it has some."""
    if not run.endpoint:
        return Endpoints(config_file=Path(run.zenoh_config))
    return endpoints_of(run.endpoint, None, None, secure if run.has_keys else None, role)


def scenario_was_given() -> bool:
    """Whether whoever began the command named a scenario."""
    source = click.get_current_context().get_parameter_source("scenario")
    return source not in (None, ParameterSource.DEFAULT)


def answers(endpoints: Endpoints) -> bool:
    """Whether somebody listens at an endpoint of TCP or TLS that is connected to."""
    host, _, port = (endpoints.connect or "").partition("/")[2].rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _GLANCE_S):
            return True
    except (OSError, ValueError):
        return False


def how_to_stop(joining: Endpoints, scenario: Scenario, path: Path) -> str:
    """The command that stops a run from elsewhere; ``path``: of its scenario, named where it has to be."""
    other = [] if _is_usual(scenario) else ["--scenario", str(path)]
    return shlex.join(["abreast", "stop", *joining.options, *other])


def _is_usual(scenario: Scenario) -> bool:
    """Whether robots are told to stand, and heard, as those of the usual scenario are."""
    return _heard_at(scenario) == _heard_at(load_scenario(USUAL))


def _heard_at(scenario: Scenario) -> list[str]:
    key, robots = layout_of(scenario).heard, robots_of(scenario)
    where = [word for each in robots for word in (each.name, key(each.odom), key(each.cmd_vel))]
    return [scenario.controller.command_type, key(topics.STOP), *where]
