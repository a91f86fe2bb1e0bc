"""``abreast simulate``: the noise-free experiments of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import msgspec

from hil.commands.own_parts import load_own_parts
from hil.commands.seconds import DURATION
from hil.errors import UsageError
from hil.log.report_json import known, print_json
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario


@click.command("simulate")
@click.argument("scenario", default="turtlebot3")
@click.option("--law", help="Law in place of the scenario's, file.py:function too.")
@click.option("--duration", type=DURATION, help="Seconds to simulate.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder for pictures and CSV.")
@click.option("--stability", is_flag=True, help="Check the propositions of the paper, too; a pair only.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
def command(
    scenario: str,
    law: str | None,
    duration: float | None,
    out: Path | None,
    stability: bool,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Integrate SCENARIO without noise or delay, as the paper does, and report on it.

    A pair drives without limits, unless it is told to change sides; a chain or a flock of agents within them.
    """
    chosen = [*overrides]
    if law is not None:
        chosen.append(f"controller.law={law}")
    if duration is not None:
        chosen.append(f"run.duration_s={duration}")
    loaded = load_scenario(scenario, chosen)
    load_own_parts(loaded, estimates=False)
    result = _simulate(loaded, out, stability=stability)
    if as_json:
        print_json(result)
        return
    for key, value in known(result).items():
        click.echo(f"{key}: {_formatted(value)}", err=True)
    if out is not None:
        click.echo(f"pictures and trajectory.csv are in {out}", err=True)


def _simulate(scenario: Scenario, out: Path | None, *, stability: bool) -> dict[str, object]:
    chain, flock = scenario.chain, scenario.flock
    if not isinstance(chain, msgspec.UnsetType):
        _refuse_what_is_for_a_pair(scenario, "chain", stability=stability)
        if not isinstance(flock, msgspec.UnsetType):
            raise UsageError(
                f"scenario {scenario.name}: it has a [chain] and a [flock]; leave one of them out"
            )
        from hil.simulate.chain_simulation import simulate_chain_of

        return simulate_chain_of(scenario, chain.agents, out)
    if not isinstance(flock, msgspec.UnsetType):
        _refuse_what_is_for_a_pair(scenario, "flock", stability=stability)
        from hil.simulate.flock_simulation import simulate_flock_of

        return simulate_flock_of(scenario, flock, out)
    from hil.simulate.pair_simulation import simulate

    return simulate(scenario, out, stability=stability)


def _formatted(value: Any) -> str:
    """A result for who reads it: six digits, and of a long list its length and range."""
    match value:
        case dict():
            return ", ".join(
                f"{key} ({_formatted(item)})" if isinstance(item, dict) else f"{key} {_formatted(item)}"
                for key, item in value.items()
            )
        case [first, _, _, *_, last] if isinstance(first, float):
            return f"{len(value)} from {_formatted(first)} to {_formatted(last)}"
        case list():
            separator = "; " if any(isinstance(item, dict) for item in value) else " to "
            return separator.join(map(_formatted, value))
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.6g}"
    return str(value)


def _refuse_what_is_for_a_pair(scenario: Scenario, section: str, *, stability: bool) -> None:
    asked = {"--stability": stability, "formation.change_sides_at_s": scenario.formation.change_sides_at_s}
    for name, given in asked.items():
        if given:
            raise UsageError(f"{name} is for a pair, and {scenario.name} has a [{section}]; leave it out")
