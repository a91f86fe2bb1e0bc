"""``abreast recover``: a cut-off log made whole."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("recover")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="LOG", help="The whole log.")
def command(log: Path, out: Path) -> None:
    """Copy all that is whole in LOG to a new log that every reader opens."""
    from hil.log.recovery import recover

    done = recover(log, out)
    lost = "nothing is missing" if done.complete else f"cut off; {done.lost_bytes} bytes were of no use"
    if done.last_ns is not None and done.lost_until_ns is not None:
        lost += f", {max(0, done.lost_until_ns - done.last_ns) * 1e-9:.3f} s or more are lost"
    click.echo(f"{out}: {done.messages} messages, {done.bytes} bytes; {log} {lost}", err=True)
