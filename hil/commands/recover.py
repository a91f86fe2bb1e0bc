"""``abreast recover``: a cut-off log made whole."""

from __future__ import annotations

from pathlib import Path

import click

from hil.commands.outputs import OutputFile
from hil.errors import CheckFailedError
from hil.log.report_json import print_json


@click.command("recover")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=OutputFile(), metavar="LOG", help="The whole log.")
@click.option("--json", "as_json", is_flag=True, help="Print what came of it as one JSON object on stdout.")
def command(log: Path, out: Path, as_json: bool) -> None:
    """Copy all that is whole in LOG to a new log that every reader opens.

    Exit code 1 where something is gone in the midst of it.
    """
    from hil.log.recovery import recover

    done = recover(log, out)
    lost = "nothing is missing" if done.complete else f"cut off; {done.lost_bytes} bytes were of no use"
    if done.damaged:
        lost = f"damaged; {done.said()}"
    if done.last_ns is not None and done.lost_until_ns is not None:
        lost += f", {max(0, done.lost_until_ns - done.last_ns) * 1e-9:.3f} s or more are lost"
    click.echo(f"{out}: {done.messages} messages, {done.bytes} bytes; {log} {lost}", err=True)
    if as_json:
        print_json(
            {
                "messages": {"kept": done.messages, "lost": done.lost},
                "gaps": [{"from_s": first, "to_s": last} for first, last in done.gaps_s()],
            }
        )
    if done.damaged:
        raise CheckFailedError(f"log {log}: {done.said()}; {out} has what is left")
