"""``abreast doctor``: the check before anything moves."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.seconds import DURATION
from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import note, print_with_nulls, result_console

if TYPE_CHECKING:
    from hil.doctor.check import Check
    from hil.scenario.schema import Scenario
    from hil.wire.session import Endpoints


@click.command("doctor", params=wire_options())
@click.argument("scenario", default="turtlebot3")
@click.option("--duration", type=DURATION, default=5.0, show_default=True, help="Seconds to listen.")
@click.option("--drive", metavar="ROBOT", help="Let this robot creep and turn, after a countdown.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("."), help="Where logs are to be written."
)
@click.option("--json", "as_json", is_flag=True, help="Print the checks as one JSON object on stdout.")
def command(
    scenario: str,
    connect: str | None,
    listen: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    duration: float,
    drive: str | None,
    out: Path,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """Look at the lab of SCENARIO, and say what is wrong and what to do about it.

    Nothing moves without --drive, and then within 0.05 m/s and 0.3 rad/s. Ends with 1 if a check failed.
    """
    with collector_paused():
        from hil.doctor.machine_checks import disk_check
        from hil.scenario.files import load_scenario
        from hil.scenario.guarded import with_guards

    chosen = with_guards(load_scenario(scenario, overrides))
    findings: list[dict[str, Any]] = []
    endpoints = endpoints_of(connect, listen, zenoh_config, secure, "operator")
    checks = [disk_check(out), *_visited(chosen, endpoints, duration, drive, findings)]
    if as_json:
        print_with_nulls({"checks": [each.as_dict() for each in checks], "findings": findings})
    else:
        _show(checks)
    sys.exit(int(not all(each.ok for each in checks)))


def _visited(
    scenario: Scenario,
    endpoints: Endpoints,
    duration: float,
    drive: str | None,
    findings: list[dict[str, Any]],
) -> Iterator[Check]:
    """Checks of all that can be reached by the wire; what estimators find is put to the findings."""
    with collector_paused():
        from hil.doctor.access_check import access_of_lab
        from hil.doctor.machine_checks import port_check, route_check
        from hil.doctor.visit import Visit
        from hil.wire.key_layout import layout_of
        from hil.wire.pubsub import joined
        from hil.wire.session import NoRouterError

    if endpoints.listen:
        taken = port_check(*_place(endpoints.listen))
        yield taken
        if not taken.ok:
            return
    try:
        with joined(endpoints, scenario, "doctor", patience=3.0) as wire:
            yield route_check(endpoints.describe(), "")
            yield access_of_lab(endpoints, wire.shown_names())
            visit = Visit(scenario, wire)
            examination = visit.examination
            robot = examination.robot(drive) if drive else None
            _say(f"listens for {duration:g} s")
            visit.listen(duration)
            driven: list[Check] = []
            if robot is not None:
                hindrance = examination.hindrance(robot)
                if hindrance is None:
                    visit.count_down(robot, _say)
                    hindrance = examination.hindrance(robot)
                if hindrance is not None:
                    driven = [hindrance]
                else:
                    visit.ending.on_signals()
                    try:
                        driven = examination.drive(robot, visit.tell)
                    finally:
                        visit.ending.leave_signals()
            now_ns = time.time_ns()
            findings += examination.findings(now_ns)
            yield from examination.checks(wire.graph(), layout_of(scenario), now_ns)
            yield from driven
    except NoRouterError as error:
        yield route_check(endpoints.describe(), str(error))


def _say(line: str) -> None:
    note(f"abreast doctor: {line}")


def _place(endpoint: str) -> tuple[int, str]:
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return int(port) if port.isdecimal() else 0, host.strip("[]")


def _show(checks: list[Check]) -> None:
    """A table: what is well in few words, what is not with what to do."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    for title in ("", "check", "seen", "expected"):
        table.add_column(title, overflow="fold")
    for each in checks:
        mark = Text("ok") if each.ok else Text("no", "red")
        table.add_row(mark, each.name, Text(each.seen), Text("" if each.ok else each.expected))
        if each.advice:
            table.add_row("", "", Text(each.advice, "bold"), "")
    result_console().print(table)
