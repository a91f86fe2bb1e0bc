"""``abreast recover``: a log that is cut off or damaged made whole."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.outputs import OutputFile
from hil.commands.progress import doing
from hil.errors import CheckFailedError
from hil.log.report_json import print_json, say

if TYPE_CHECKING:
    from hil.log.recovery import Recovery


@click.command("recover")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=OutputFile(), metavar="LOG", help="The whole log.")
@click.option("--json", "as_json", is_flag=True, help="Print what came of it as one JSON object on stdout.")
def command(log: Path, out: Path, as_json: bool) -> None:
    """Copy all that is whole in LOG to a new log that every reader opens.

    Exit code 0 if nothing is gone, 1 if something is, 2 if nothing of LOG can be read.
    """
    from hil.log.recovery import recover

    with doing("copying what is whole"):
        done = recover(log, out)
    say(f"{out}: {done.messages} messages, {done.bytes} bytes; {log} {_said(done)}")
    if as_json:
        print_json(
            {
                "messages": {"kept": done.messages, "lost": done.lost},
                "gaps": [{"from_s": first, "to_s": last} for first, last in done.gaps_s()],
            }
        )
    if not done.complete:
        raise CheckFailedError(f"log {log}: {done.said()}; {out} has what is left")


def _said(done: Recovery) -> str:
    """How the log was, in words."""
    if done.complete:
        how = "lacks nothing"
    elif done.damaged:
        how = f"is damaged; {done.said()}"
    else:
        how = f"is cut off; its last {done.lost_bytes} bytes were of no use"
    if done.last_ns is not None and done.lost_until_ns is not None:
        how += f", {max(0, done.lost_until_ns - done.last_ns) * 1e-9:.3f} s or more are lost"
    if done.restored:
        how += f"; its metadata {', '.join(done.restored)} were damaged and are what its messages tell"
    return how
