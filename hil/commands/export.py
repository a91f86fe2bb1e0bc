"""``abreast export``: logs as tables for pandas, polars and spreadsheets, or as files for viewers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.outputs import OutputFolder
from hil.errors import CheckFailedError, UsageError
from hil.extras import begin_to_judge
from hil.log.report_json import note, print_json, results_apart, say

if TYPE_CHECKING:
    from hil.exports.table_export import TableExport
    from hil.exports.table_file import Format
    from hil.judge.replayed import ReplayChoice
    from hil.log.reader import Log

_FORMATS = ("csv", "parquet", "foxglove")


@click.command("export")
@click.argument("log", required=False, type=click.Path(path_type=Path))
@click.option("--to", "folder", type=OutputFolder(), metavar="DIR", help="Where it goes.")
@click.option("--format", "form", type=click.Choice(_FORMATS), help="[parquet, without pyarrow csv]")
@click.option("--layouts", type=OutputFolder(), metavar="DIR", help="Write the viewers' layouts there.")
@click.option("--overwrite", is_flag=True, help="Write over an export that is there already.")
@click.option("--map", "chart", metavar="FILE", help="Names the topics of a log that is not abreast's.")
@click.option("--leader", metavar="NAME", help="Name of the leader's body.")
@click.option("--follower", metavar="NAME", help="Name of the follower's body.")
@click.option("--estimator", metavar="E", help="Estimates made anew by this one, not those of the log.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Made anew with another key.")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON on stdout.")
@results_apart()
@collector_paused()
def command(
    log: Path | None,
    folder: Path | None,
    form: str | None,
    layouts: Path | None,
    overwrite: bool,
    chart: str | None,
    leader: str | None,
    follower: str | None,
    estimator: str | None,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write LOG as tables: DIR/aligned, a row for each estimate, and DIR/topics, a table for each topic.

    With --format foxglove as DIR/foxglove.mcap for Foxglove, Lichtblick, RViz and PlotJuggler, with
    transforms, a scene, and layouts. Estimates are those of the log; where it has none they are made as
    replay does. docs/export.md has all columns, docs/foxglove.md the viewers.
    """
    if log is None or folder is None:
        if layouts is None or log is not None or folder is not None:
            raise UsageError("export: expected LOG and --to DIR, or --layouts DIR alone")
        _write_layouts(layouts, overwrite=overwrite)
        return
    from hil.judge.replayed import ReplayChoice
    from hil.log.opened import opened_log

    choice = ReplayChoice(
        estimator=estimator,
        leader=leader,
        follower=follower,
        chart=chart,
        overrides=overrides,
        in_messages=True,
    )
    begin_to_judge("export")
    if not overwrite:
        _refuse_present(folder, form)
    if layouts is not None:
        _write_layouts(layouts, overwrite=overwrite)
    write = _write_foxglove if form == "foxglove" else _write_tables
    write(opened_log(log), folder, form, choice, as_json=as_json)


def _refuse_present(folder: Path, form: str | None) -> None:
    from hil.exports.refusal import refuse_present

    if form == "foxglove":
        from hil.exports.foxglove_export import WRITTEN

        refuse_present(folder, WRITTEN)
    else:
        from hil.exports.table_export import TABLES

        refuse_present(folder, TABLES)


def _write_layouts(folder: Path, *, overwrite: bool) -> None:
    from hil.exports.layouts import LAYOUTS, write_layouts
    from hil.exports.refusal import refuse_present

    if not overwrite:
        refuse_present(folder, LAYOUTS)
    for path in write_layouts(folder):
        say(str(path))


def _write_foxglove(
    log: Log, folder: Path, _form: str | None, choice: ReplayChoice, *, as_json: bool
) -> None:
    from hil.exports.foxglove_export import export_foxglove

    done = export_foxglove(log, folder, choice)
    _tell_left_out(done.left_out)
    if as_json:
        print_json(done.as_dict())
    else:
        say(f"{done.path}: {sum(done.messages.values())} messages on {len(done.messages)} topics")
    _refuse_damage(log, done.damage)


def _write_tables(log: Log, folder: Path, form: str | None, choice: ReplayChoice, *, as_json: bool) -> None:
    from hil.exports.table_export import export_tables
    from hil.exports.table_file import has_parquet

    if form is None and not has_parquet():
        note("tables are written as CSV; for Parquet: pip install 'abreast[tables]'")
    chosen: Format = "csv" if form == "csv" or (form is None and not has_parquet()) else "parquet"
    done = export_tables(log, folder, chosen, choice)
    _tell(done, as_json=as_json)
    _refuse_damage(log, done.damage)


def _refuse_damage(log: Log, damage: str) -> None:
    """Fail for what is gone of a log, now that the rest has been written."""
    if damage:
        raise CheckFailedError(f"log {log.path}: {damage}")


def _tell_left_out(left_out: Mapping[str, str]) -> None:
    for topic, why in left_out.items():
        note(f"topic {topic}: left out: {why}")


def _tell(done: TableExport, *, as_json: bool) -> None:
    for topic, count in done.topics.malformed.items():
        note(f"topic {topic}: {count} payloads are no message of its type, and left out")
    _tell_left_out(done.topics.left_out)
    if done.older:
        note(f"still there from an export before: {', '.join(done.older)}")
    told: dict[str, Any] = done.as_dict()
    if as_json:
        print_json(told)
        return
    rows = ", ".join(f"{count} of {name}" for name, count in done.rows.items())
    say(f"{told['aligned']}: {done.estimates} estimates: {rows or 'none'}")
    for path, count in told["topics"].items():
        say(f"{path}: {count} messages")
