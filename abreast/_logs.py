"""Logs, and what comes of them when they are replayed."""

from __future__ import annotations

import os
from pathlib import Path

from abreast._runs import Run, run_of
from abreast._scenarios import Own, text_of
from formation.collector import collector_paused
from hil.errors import CheckFailedError
from hil.exports.refusal import refuse_present
from hil.exports.table_export import TABLES, TableExport, export_tables
from hil.exports.table_file import Format
from hil.judge.replayed import ReplayChoice, replayed
from hil.log.opened import opened_log
from hil.log.reader import Log
from hil.scenario.files import Overrides

LogLike = Log | str | os.PathLike[str]
"""A log that is open, or its path."""


def read_log(log: str | os.PathLike[str]) -> Log:
    """Open a log, ours or a bag of ROS, file or folder: check that it is whole, read all but its messages.

    Raises :class:`UsageError` if it is missing, no such thing, cut off or damaged.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 2.0})
    >>> run = abreast.run_lockstep(scenario, log="read.mcap")
    >>> log = abreast.read_log("read.mcap")
    >>> log.topics["truth"], log.messages == run.summary["log"]["messages"]
    ('abreast_msgs/msg/Truth', True)
    """
    return opened_log(Path(log))


def log_of(given: LogLike) -> Log:
    """The log that is meant."""
    return given if isinstance(given, Log) else read_log(given)


@collector_paused()
def replay(
    log: LogLike,
    *,
    estimator: Own | None = None,
    law: Own | None = None,
    overrides: Overrides = (),
    leader: str | None = None,
    follower: str | None = None,
    topic_map: str | os.PathLike[str] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    verify: bool = False,
    certify: bool = False,
) -> Run:
    """Put a log through the very steps that run live, and judge what comes out: ``abreast replay``.

    ``estimator``, ``overrides`` (values by ``section.key``): in place of the log's. ``law``: where the log's
    own is now, or another to judge by. ``leader``, ``follower``: names of the bodies; of a chain, the
    follower to look at. ``topic_map``: a file that names the topics of a log that is not abreast's.
    ``from_s``, ``to_s`` [s] limit what is judged. ``verify``: compare with what was recorded, bit for bit,
    and raise :class:`CheckFailedError` if anything differs. ``certify``: judge a guaranteed error radius of
    every estimate too. Raises :class:`UsageError` for a log that cannot be read or replayed so.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 4.0})
    >>> run = abreast.run_lockstep(scenario, log="again.mcap")
    >>> again = abreast.replay("again.mcap", verify=True)
    >>> again.summary["parity"]["estimates"]["mismatched"]
    0
    >>> abreast.replay("again.mcap", estimator="smoother").summary["estimator"]
    'smoother'
    """
    given = log_of(log)
    chart = None if topic_map is None else os.fspath(topic_map)
    choice = ReplayChoice(
        estimator=text_of(estimator),
        law=text_of(law),
        leader=leader,
        follower=follower,
        chart=chart,
        overrides=overrides,
        from_s=from_s,
        to_s=to_s,
        verify=verify,
        certify=certify,
        in_messages=True,
    )
    done = replayed(given, choice)
    if verify and (reason := done.why_not_same(given)):
        raise CheckFailedError(reason)
    return run_of(done.summary, done.runs)


@collector_paused()
def export(
    log: LogLike,
    folder: str | os.PathLike[str],
    *,
    form: Format = "parquet",
    estimator: Own | None = None,
    overrides: Overrides = (),
    leader: str | None = None,
    follower: str | None = None,
    topic_map: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> TableExport:
    """Write a log as tables: ``aligned``, a row for each estimate, and ``topics``, one for each topic.

    ``form``: parquet or csv. Estimates are those of the log, unless one of the others asks for new ones, as
    :func:`abreast.replay` makes them, or it has none. Raises :class:`UsageError` for a log that cannot be
    read or replayed so, and for a folder that has an export already, unless ``overwrite``.

    >>> import abreast, pandas
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 2.0})
    >>> run = abreast.run_lockstep(scenario, log="exported.mcap")
    >>> done = abreast.export("exported.mcap", "tables")
    >>> table = pandas.read_parquet("tables/aligned.parquet")
    >>> len(table) == done.rows["follower"] == len(run.estimates)
    True
    """
    place = Path(folder)
    if not overwrite:
        refuse_present(place, TABLES)
    choice = ReplayChoice(
        estimator=text_of(estimator),
        leader=leader,
        follower=follower,
        chart=None if topic_map is None else os.fspath(topic_map),
        overrides=overrides,
        in_messages=True,
    )
    return export_tables(log_of(log), place, form, choice)
