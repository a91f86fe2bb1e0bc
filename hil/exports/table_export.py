"""A log as tables in a folder: one for all estimates, and one for each topic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil.exports.aligned_columns import ALIGNED_COLUMNS
from hil.exports.aligned_table import aligned_rows
from hil.exports.logged_run import LoggedRun, recorded_run, replayed_run
from hil.exports.sources import of_what_is_whole, recorded_links
from hil.exports.table_file import Format, table_file
from hil.exports.topic_tables import TopicTables, write_topics
from hil.judge.replayed import ReplayChoice, replayed
from hil.log.reader import Log
from hil.log.table_column import TableColumn
from hil.scenario.links import Link

TOPICS = "topics"
"""Folder of the tables of topics."""

COLUMNS = "columns.csv"
"""What the columns of the aligned table are, beside one in CSV."""

TABLES = ("aligned.csv", "aligned.parquet", COLUMNS, TOPICS)
"""All that an export of any format may write into its folder."""


@dataclass(slots=True)
class TableExport:
    """What was written: rows of the aligned table by follower, and the tables of topics.

    ``estimates``: whether its estimates are those of the log, ``recorded``, or ``replayed``, made anew.
    ``damage``: what is gone of the log. ``older``: tables that lie there from an export before.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 2.0})
    >>> run = abreast.run_lockstep(scenario, log="told.mcap")
    >>> done = abreast.export("told.mcap", "told", form="csv")
    >>> done.estimates, done.topics.rows["follower/leader_estimate.csv"] == done.rows["follower"]
    ('recorded', True)
    """

    folder: Path
    form: Format
    estimates: str
    rows: dict[str, int] = field(default_factory=dict)
    topics: TopicTables = field(default_factory=TopicTables)
    damage: str = ""
    older: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """The same as JSON."""
        return {
            "aligned": str(self.folder / f"aligned.{self.form}"),
            "estimates": self.estimates,
            "rows": self.rows,
            "topics": {str(self.folder / TOPICS / name): rows for name, rows in self.topics.rows.items()},
            "malformed": self.topics.malformed,
            "left_out": self.topics.left_out,
            "damage": self.damage or None,
            "older": self.older,
        }


def export_tables(log: Log, folder: Path, form: Format, choice: ReplayChoice) -> TableExport:
    """Write a log's tables; of a damaged log what is whole.

    Estimates are those that the log has, unless ``choice`` asks for others or it has none: then they are made
    anew, as a replay does. Raises :class:`UsageError` for what cannot be replayed so or written.
    """
    return of_what_is_whole(log, lambda whole: _export(whole, folder, form, choice))


def _export(log: Log, folder: Path, form: Format, choice: ReplayChoice) -> TableExport:
    links = recorded_links(log, choice)
    done = TableExport(folder, form, "recorded" if links else "replayed", damage=log.damage)
    with table_file(folder / f"aligned.{form}", ALIGNED_COLUMNS, form) as table:
        for run in _runs(log, links, choice):
            done.rows[run.follower] = len(run.estimates["rho"])
            for rows in aligned_rows(run):
                table.write(rows)
    if form == "csv":
        _describe(folder / COLUMNS)
    done.topics = write_topics(log, folder / TOPICS, form)
    done.older = _older(done)
    return done


def _older(done: TableExport) -> list[str]:
    """Tables in the folder that this export has not written."""
    folder = done.folder
    written = {folder / f"aligned.{done.form}", *(folder / TOPICS / name for name in done.topics.rows)}
    there = [*folder.glob("aligned.*"), *(folder / TOPICS).rglob("*.*")]
    tables = {path for path in there if path.suffix in (".csv", ".parquet")}
    return sorted(str(path) for path in tables - written)


def _runs(log: Log, links: Sequence[Link], choice: ReplayChoice) -> Iterator[LoggedRun]:
    if links:
        yield from (recorded_run(log, link) for link in links)
        return
    yield from map(replayed_run, replayed(log, choice).runs)


def _describe(path: Path) -> None:
    import numpy as np

    names = TableColumn._fields
    heads = [TableColumn(name, "", "") for name in names]
    columns = [np.array(values, dtype=object) for values in zip(*ALIGNED_COLUMNS, strict=True)]
    with table_file(path, heads, "csv") as table:
        table.write(columns)
