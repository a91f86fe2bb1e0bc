"""``abreast scenario``: scenarios listed, shown as they are resolved, and begun."""

from __future__ import annotations

import os
from pathlib import Path

import click
import msgspec

from hil.commands.command_group import CommandGroup
from hil.commands.outputs import refuse_unwritable
from hil.errors import UsageError
from hil.log.report_json import print_json, print_text, say


@click.group("scenario", cls=CommandGroup)
def command() -> None:
    """List scenarios, show one as it is resolved, or begin one of your own."""


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print them as one JSON object on stdout.")
def list_scenarios(as_json: bool) -> None:
    """List the scenarios that abreast ships: name, and what each is."""
    from hil.scenario.files import load_scenario, scenario_names

    found = {name: load_scenario(name).description for name in scenario_names()}
    if as_json:
        print_json({"scenarios": [{"name": name, "description": text} for name, text in found.items()]})
        return
    width = max(map(len, found))
    for name, text in found.items():
        say(f"{name:{width}}  {text}")


@command.command("show")
@click.argument("scenario", metavar="NAME", default="turtlebot3")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--json", "as_json", is_flag=True, help="Print it as one JSON object on stdout.")
def show(scenario: str, overrides: tuple[str, ...], as_json: bool) -> None:
    """Print scenario NAME with all its keys, defaults included, as TOML that abreast reads back."""
    from hil.scenario.files import load_scenario, scenario_text

    chosen = load_scenario(scenario, overrides)
    if as_json:
        print_json(msgspec.to_builtins(chosen))
    else:
        print_text(scenario_text(chosen))


@command.command("new")
@click.argument("file", type=click.Path(path_type=Path), default="my_lab.toml")
@click.option(
    "--from", "scenario", metavar="NAME", default="turtlebot3", show_default=True, help="What it begins as."
)
def new(file: Path, scenario: str) -> None:
    """Write FILE, a scenario of a lab of your own: what NAME has, with what each key means.

    Nothing is overwritten.
    """
    from hil.scenario.files import load_scenario, scenario_names
    from hil.scenario.new_scenario import begun_from

    base = scenario if scenario in scenario_names() else os.path.relpath(scenario, file.parent)
    text = begun_from(load_scenario(scenario), base)
    refuse_unwritable(file, "FILE")
    try:
        with file.open("x", encoding="utf-8") as written:
            written.write(text)
    except FileExistsError:
        raise UsageError(f"{file}: is there already; give another name, or move it away") from None
    except OSError as error:
        raise UsageError(f"{file}: cannot be written ({error.strerror}); give another") from None
    say(f"{file}: begun from {scenario}; go on with: abreast run {file}")
