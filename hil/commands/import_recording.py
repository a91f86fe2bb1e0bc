"""``abreast import``: other recordings turned into logs."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click


@click.group("import")
def command() -> None:
    """Turn a recording that is not a log into one, for replay."""


@command.command("csv")
@click.argument("recording", type=click.Path(path_type=Path))
@click.option(
    "--map", "chart", required=True, metavar="FILE", help="Column map: a TOML file or a shipped name."
)
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="LOG", help="The log to write."
)
def import_table(recording: Path, chart: str, out: Path) -> None:
    """Turn the CSV file RECORDING into a log by a map of its columns."""
    from hil.recordings.column_map import load_column_map
    from hil.recordings.csv_import import import_csv

    done = import_csv(recording, load_column_map(chart), out)
    if done.torn:
        click.echo(f"{recording}: line {done.torn} is cut off; it is left out", err=True)
    click.echo(
        f"{out}: {done.rows} rows from {done.from_s:g} s to {done.to_s:g} s; "
        f"go on with: abreast replay {out}",
        err=True,
    )


@command.command("mrclam")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--leader", required=True, type=int, metavar="N", help="Number of the robot that leads.")
@click.option("--follower", required=True, type=int, metavar="N", help="Number of the robot that follows.")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="LOG", help="The log to write."
)
@click.option(
    "--sightings",
    type=click.Choice(["vicon", "camera"]),
    default="vicon",
    show_default=True,
    help="Who sees the leader: the motion capture, or the follower's camera.",
)
def import_mrclam_pair(
    folder: Path, leader: int, follower: int, out: Path, sightings: Literal["vicon", "camera"]
) -> None:
    """Turn two robots of the UTIAS multi-robot data set in FOLDER into a log."""
    from hil.recordings.mrclam_import import import_mrclam

    done = import_mrclam(folder, leader, follower, out, sightings)
    kind = "frames" if sightings == "vicon" else "sightings"
    click.echo(
        f"{out}: {done.rows} {kind} from {done.from_s:.3f} s to {done.to_s:.3f} s; "
        f"go on with: abreast replay {out}",
        err=True,
    )
