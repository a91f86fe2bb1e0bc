"""``abreast gains``: gains for a scenario's robots, leader, delays and noise, each with its reason."""

from __future__ import annotations

import click

from hil.commands.progress import doing
from hil.log.report_json import print_json, say
from hil.scenario.files import load_scenario


@click.command("gains")
@click.argument("scenario", default="turtlebot3")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--json", "as_json", is_flag=True, help="Print the proposal as one JSON object.")
def command(scenario: str, overrides: tuple[str, ...], as_json: bool) -> None:
    """Propose gains for SCENARIO, and say for each what bounds it; or say why none work."""
    chosen = load_scenario(scenario, overrides)
    with doing("looking for gains"):
        from hil.simulate.gain_proposal import propose, report_lines

        proposal = propose(chosen)
    if as_json:
        print_json(proposal.as_dict())
        return
    for line in report_lines(proposal):
        say(line)
