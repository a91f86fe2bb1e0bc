"""``abreast export``: logs as tables for pandas, polars and spreadsheets, and for the viewers of others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.outputs import OutputFolder
from hil.errors import CheckFailedError
from hil.log.report_json import print_json, print_text, results_apart

if TYPE_CHECKING:
    from hil.exports.table_export import TableExport
    from hil.exports.table_file import Format
    from hil.judge.replayed import ReplayChoice
    from hil.log.reader import Log

_FORMATS = ("csv", "parquet")


@click.command("export")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--to", "folder", required=True, type=OutputFolder(), metavar="DIR", help="Where it goes.")
@click.option("--format", "form", type=click.Choice(_FORMATS), help="[parquet, without pyarrow csv]")
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
    log: Path,
    folder: Path,
    form: str | None,
    overwrite: bool,
    chart: str | None,
    leader: str | None,
    follower: str | None,
    estimator: str | None,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write LOG as tables: DIR/aligned, a row for each estimate, and DIR/topics, a table for each topic.

    Estimates are those of the log; where it has none they are made as replay does. docs/export.md has all
    columns.
    """
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
    _write_tables(opened_log(log), folder, form, choice, overwrite=overwrite, as_json=as_json)


def _write_tables(
    log: Log, folder: Path, form: str | None, choice: ReplayChoice, *, overwrite: bool, as_json: bool
) -> None:
    from hil.exports.table_export import export_tables, refuse_present
    from hil.exports.table_file import has_parquet

    if not overwrite:
        refuse_present(folder)
    if form is None and not has_parquet():
        click.echo("pyarrow is not there, so tables are written as CSV", err=True)
    chosen: Format = "csv" if form == "csv" or (form is None and not has_parquet()) else "parquet"
    done = export_tables(log, folder, chosen, choice)
    _tell(done, as_json=as_json)
    if done.damage:
        raise CheckFailedError(f"log {log.path}: {done.damage}")


def _tell(done: TableExport, *, as_json: bool) -> None:
    for topic, count in done.topics.malformed.items():
        click.echo(f"topic {topic}: {count} payloads are no message of its type, and left out", err=True)
    for topic, why in done.topics.left_out.items():
        click.echo(f"topic {topic}: left out: {why}", err=True)
    told: dict[str, Any] = done.as_dict()
    if as_json:
        print_json(told)
        return
    rows = ", ".join(f"{count} of {name}" for name, count in done.rows.items())
    print_text(f"{told['aligned']}: {done.estimates} estimates: {rows or 'none'}\n")
    for path, count in told["topics"].items():
        print_text(f"{path}: {count} messages\n")
