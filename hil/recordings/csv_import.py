"""Turning a CSV recording into a log, as if its rows had come over the wire."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.body_tracks import turned_up
from hil.recordings.column_map import ColumnMap, check_columns
from hil.recordings.csv_table import Heading, Table, read_heading, read_table, told_unit
from hil.recordings.imported import Imported, at_rate_of, imported, rate_of
from hil.recordings.known_columns import known_columns
from hil.recordings.pair_log import TRUTH, Recorded, planar_placements, write_pair
from hil.recordings.text_file import Text, read_text
from hil.scenario.files import with_overrides


def import_csv(recording: Path, chart: ColumnMap, out: Path) -> Imported:
    """Write the rows of a CSV file to the new log ``out``. Stamps are the recording's own times.

    Raises :class:`UsageError` as :func:`hil.recordings.text_file.read_text` and :func:`import_columns`.
    """
    return import_columns(recording, read_text(recording), chart, out)


def import_columns(recording: Path, text: Text, chart: ColumnMap, out: Path) -> Imported:
    """Write the rows of a text that was read to the new log ``out``.

    Raises :class:`UsageError` as :func:`hil.recordings.csv_table.read_table`, before anything is written, and
    if ``out`` exists or cannot be created. No half log is left behind.
    """
    heading = read_heading(recording, text, chart.delimiter, chart.decimal)
    if not chart.columns:
        chart = _by_names(recording, heading, chart)
    table = read_table(recording, text, heading, chart)
    recorded = recorded_of(table, chart)
    source = {"file": recording.name}
    if chart.path is not None:
        source["map"] = chart.path.name
    scenario = chart.scenario if chart.path is not None else at_rate_of(recorded, chart.scenario)
    messages = write_pair(out, recorded, scenario, source)
    damage = (*text.damage, *(f"line {line} {fault}" for line, fault in table.damaged.items()))
    return imported(recorded, scenario, messages, _taken_for(text, heading, table, chart), damage)


def _by_names(recording: Path, heading: Heading, chart: ColumnMap) -> ColumnMap:
    """The map of a table whose columns are known by their names."""
    try:
        known = known_columns(heading.names, heading.units)
    except UsageError as error:
        raise UsageError(f"recording {recording}: {error}") from None
    found = replace(chart, columns=known.columns, truth=known.truth | chart.truth)
    if found.sighted and chart.path is None:
        found = replace(found, scenario=with_overrides(chart.scenario, {"estimator.front_end": "body"}))
    check_columns(found, f"recording {recording}")
    return found


def _taken_for(text: Text, heading: Heading, table: Table, chart: ColumnMap) -> str:
    """What a table was taken for, in a line."""
    used = {name: source for name, source in chart.columns.items() if source.column is not None}
    units = sorted({unit for name, source in used.items() if (unit := told_unit(heading, name, source))})
    what = ", ".join(f"{name} = {source.column!r}" for name, source in used.items())
    rates = f"{rate_of(table.t_ns):.4g} Hz"
    moved = table.columns.get("v2")
    if moved is not None and (rows := np.flatnonzero(np.isfinite(moved))).size > 1:
        slower = rate_of(table.t_ns[rows])
        rates += f", v2 and u2 at {slower:.4g} Hz" if slower < 0.9 * rate_of(table.t_ns) else ""
    facts = ["table of columns", heading.layout.words, text.encoding, f"times in {table.times}"]
    facts += [f"units {', '.join(units)}" if units else "SI units", f"{chart.up} up", rates, what]
    return "; ".join(facts)


def recorded_of(table: Table, chart: ColumnMap) -> Recorded:
    """What a table has of a pair."""
    given = table.columns
    truth = None
    if table.truth:
        unknown = np.full(len(table.t_ns), np.nan)
        truth = np.column_stack([table.truth.get(name, unknown) for name in TRUTH])
    return Recorded(
        t_ns=table.t_ns,
        leader=_placements("leader", given, chart.up) if "leader_x" in given else None,
        follower=_placements("follower", given, chart.up) if "follower_x" in given else None,
        motion=np.column_stack([given["v2"], given["u2"]]) if "v2" in given else None,
        sighting=np.column_stack([given["rho"], given["alpha2"]]) if "rho" in given else None,
        truth=truth,
        commanded=chart.commanded,
    )


def _placements(role: str, given: dict[str, FloatArray], up: str) -> FloatArray:
    """Poses of a robot: by its heading, by its quaternion, or without one."""
    x, y = given[f"{role}_x"], given[f"{role}_y"]
    level = np.zeros_like(x)
    z = given.get(f"{role}_z", level)
    if f"{role}_qw" in given:
        quaternion = [given[f"{role}_q{axis}"] for axis in "xyzw"]
        return turned_up(np.column_stack([x, y, z, *quaternion]), up)
    if up == "y":
        return turned_up(np.column_stack([x, y, z, level, level, level, level + 1.0]), up)
    placements = planar_placements(x, y, given.get(f"{role}_theta", level))
    placements[:, 2] = z
    return placements
