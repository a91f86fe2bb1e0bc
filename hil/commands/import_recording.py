"""``abreast import``: other recordings turned into logs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

import click

from hil.commands.command_group import CommandGroup
from hil.commands.outputs import OutputFile, refuse_unwritable
from hil.commands.progress import doing
from hil.commands.whole_numbers import Whole
from hil.errors import AbreastError, UsageError
from hil.log.report_json import note, say

if TYPE_CHECKING:
    from hil.recordings.column_map import ColumnMap
    from hil.recordings.imported import Imported

_SHOWN = 5
Callback = TypeVar("Callback", bound=Callable[..., None])


@click.group("import", cls=CommandGroup)
def command() -> None:
    """Turn a recording that is not a log into one, for replay."""


def _target(function: Callback) -> Callback:
    """Options of what is written, and by which scenario."""
    options = (
        click.option("--out", type=OutputFile(), metavar="LOG", help="The log to write."),
        click.option("--map", "chart", metavar="FILE", help="Column map: a TOML file or a shipped name."),
        click.option(
            "--scenario", metavar="NAME", help="Scenario without a map: a shipped name or a TOML file."
        ),
        click.option(
            "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key of the scenario."
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


@command.command("csv")
@click.argument("recording", type=click.Path(path_type=Path))
@_target
@click.option("--leader", metavar="NAME", help="Body that leads, in an export of a motion capture.")
@click.option("--follower", metavar="NAME", help="Body that follows.")
def import_table(
    recording: Path,
    out: Path | None,
    chart: str | None,
    scenario: str | None,
    overrides: tuple[str, ...],
    leader: str | None,
    follower: str | None,
) -> None:
    """Turn RECORDING into a log: an export of Motive or QTM, or a table of columns.

    Columns are known by a map or by their names. What the recording is taken for is told.
    """
    from hil.recordings.track_import import import_recording

    log = out or Path(f"{recording.stem}.mcap")
    refuse_unwritable(log, "--out")
    used = _chart(recording.stem, chart, scenario, overrides)
    with doing("importing"):
        done = import_recording(recording, used, log, leader, follower)
    _tell(str(recording), log, done)


@command.command("tum")
@click.argument("leader", type=click.Path(path_type=Path))
@click.argument("follower", type=click.Path(path_type=Path))
@_target
def import_tum_pair(
    leader: Path,
    follower: Path,
    out: Path | None,
    chart: str | None,
    scenario: str | None,
    overrides: tuple[str, ...],
) -> None:
    """Turn the trajectories LEADER and FOLLOWER, rows of t x y z qx qy qz qw, into a log."""
    from hil.recordings.track_import import import_tum

    log = out or Path(f"{leader.stem}_{follower.stem}.mcap")
    refuse_unwritable(log, "--out")
    used = _chart(log.stem, chart, scenario, overrides)
    with doing("importing"):
        done = import_tum(leader, follower, used, log)
    _tell(f"{leader}, {follower}", log, done)


def _chart(name: str, chart: str | None, scenario: str | None, overrides: tuple[str, ...]) -> ColumnMap:
    from hil.recordings.column_map import load_column_map, no_map

    if chart is None:
        return no_map(name, scenario, overrides)
    if scenario is not None:
        raise UsageError("--scenario: the map says by which scenario; set base in its [scenario] section")
    return load_column_map(chart, overrides)


def _tell(recording: str, log: Path, done: Imported) -> None:
    """Say what was found; exit 1 if a part of the recording is damaged."""
    say(f"{recording}: {done.taken_for}")
    for role, rows in done.gaps.items():
        say(f"{recording}: {role} missing in {rows} of {done.rows} rows")
    say(
        f"{log}: {done.rows} rows from {done.from_s:g} s to {done.to_s:g} s; go on with: abreast replay {log}"
    )
    for doubt in done.doubts:
        note(f"! {doubt}")
    if done.damage:
        shown = "; ".join(done.damage[:_SHOWN])
        rest = f"; and {len(done.damage) - _SHOWN} more" if len(done.damage) > _SHOWN else ""
        raise AbreastError(f"{recording}: is damaged: {shown}{rest}; left out of {log}, which is written")


@command.command("mrclam")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--leader", required=True, type=Whole(1), metavar="N", help="Number of the robot that leads.")
@click.option("--follower", required=True, type=Whole(1), metavar="N", help="Number of the one that follows.")
@click.option("--out", required=True, type=OutputFile(), metavar="LOG", help="The log to write.")
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

    with doing("importing"):
        done = import_mrclam(folder, leader, follower, out, sightings)
    kind = "frames" if sightings == "vicon" else "sightings"
    say(
        f"{out}: {done.rows} {kind} from {done.from_s:.3f} s to {done.to_s:.3f} s; "
        f"go on with: abreast replay {out}"
    )
