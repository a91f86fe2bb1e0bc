"""``abreast bounds``: what is guaranteed of a scenario before anything drives."""

from __future__ import annotations

import click

from hil.commands.progress import doing
from hil.log.report_json import print_json, result_console
from hil.scenario.files import load_scenario


@click.command("bounds")
@click.argument("scenario", default="turtlebot3")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--json", "as_json", is_flag=True, help="Print the certificate as one JSON object.")
def command(scenario: str, overrides: tuple[str, ...], as_json: bool) -> None:
    """Print the certificate of SCENARIO: bounds on rates, estimates and formation, and what they assume."""
    from rich.table import Table
    from rich.text import Text

    chosen = load_scenario(scenario, overrides)
    with doing("certifying"):
        from hil.scenario.certificate import certificate_json, certificate_lines, certificate_of

        certificate = certificate_of(chosen)
    if as_json:
        print_json(certificate_json(certificate))
        return
    table = Table.grid(padding=(0, 2))
    assumptions: dict[str, int] = {}
    for title, finding, assumes in certificate_lines(certificate):
        marks = " ".join(f"[{assumptions.setdefault(text, len(assumptions) + 1)}]" for text in assumes)
        table.add_row(Text(title, style="bold"), Text.assemble(finding, (f"  {marks}", "dim")))
    console = result_console()
    console.print(table)
    console.print(Text("assuming"))
    for text, number in assumptions.items():
        console.print(Text(f"[{number}] {text}", style="dim"), soft_wrap=True)
