"""``abreast simulate``: the noise-free experiments of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.commands.figures_option import figures_option, refuse_nowhere
from hil.commands.outputs import OutputFolder
from hil.commands.own_parts import load_own_parts
from hil.commands.progress import doing
from hil.commands.seconds import DURATION
from hil.log.report_json import print_json, results_apart, say
from hil.scenario.files import load_scenario

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind


@click.command("simulate")
@click.argument("scenario", default="turtlebot3")
@click.option("--law", help="Law in place of the scenario's, file.py:function too.")
@click.option("--duration", type=DURATION, help="Seconds to simulate.")
@click.option("--out", type=OutputFolder(), help="Folder for pictures and CSV.")
@click.option("--stability", is_flag=True, help="Check the propositions of the paper, too; a pair only.")
@figures_option()
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
@results_apart()
def command(
    scenario: str,
    law: str | None,
    duration: float | None,
    out: Path | None,
    stability: bool,
    figures: Kind | None,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Integrate SCENARIO without noise or delay, as the paper does, and report on it.

    A pair drives without limits, unless it is told to change sides; a chain or a flock of agents within them.
    """
    refuse_nowhere(figures, out)
    chosen = [*overrides]
    if law is not None:
        chosen.append(f"controller.law={law}")
    if duration is not None:
        chosen.append(f"run.duration_s={duration}")
    loaded = load_scenario(scenario, chosen)
    load_own_parts(loaded, estimates=False)
    with doing("simulating"):
        from hil.simulate.experiments import experiment

        result = experiment(loaded, out, stability=stability, figures=figures).as_dict()
    if as_json:
        print_json(result)
        return
    for key, value in result.items():
        say(f"{key}: {_formatted(value)}")
    if out is not None:
        say(f"pictures and trajectory.csv are in {out}")


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
