"""Turning recordings into logs: tables, exports of motion captures, pairs of trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hil.errors import UsageError
from hil.recordings.body_tracks import Export, found_up, pair_of, turned_up
from hil.recordings.column_map import ColumnMap
from hil.recordings.csv_import import import_columns
from hil.recordings.imported import Imported, at_rate_of, imported, rate_of
from hil.recordings.motive_export import is_motive, read_motive
from hil.recordings.pair_log import Recorded, write_pair
from hil.recordings.qtm_export import is_qtm, read_qtm
from hil.recordings.text_file import read_text
from hil.recordings.tum_pair import is_tum, read_tum_pair


def import_recording(
    recording: Path, chart: ColumnMap, out: Path, leader: str | None = None, follower: str | None = None
) -> Imported:
    """Write a recording to the new log ``out``: an export of Motive or QTM, or a table by its column map.

    ``leader``, ``follower``: bodies of an export. Raises :class:`UsageError` as the readers do, before
    anything is written; for names of bodies or columns where there are none; and if ``out`` exists or cannot
    be created.
    """
    text = read_text(recording)
    read = read_motive if is_motive(text) else read_qtm if is_qtm(text) else None
    if read is not None:
        if chart.columns:
            raise UsageError(
                f"{chart.name}: names columns, but {recording} is an export of bodies; leave out [columns], "
                "and name them by --leader NAME --follower NAME"
            )
        export = read(recording, text)
        export.facts.append(text.encoding)
        return import_export(export, (leader, follower), chart, out, {"file": recording.name})
    if leader is not None or follower is not None:
        raise UsageError(
            f"recording {recording}: is a table, which has no bodies; name columns by --map FILE"
        )
    if not chart.columns and is_tum(text):
        raise UsageError(
            f"recording {recording}: looks like a TUM trajectory, which is of one body; take two of them to: "
            "abreast import tum LEADER FOLLOWER"
        )
    return import_columns(recording, text, chart, out)


def import_tum(leader: Path, follower: Path, chart: ColumnMap, out: Path) -> Imported:
    """Write two trajectories in TUM's format to the new log ``out``; errors as :func:`import_recording`."""
    if chart.columns:
        raise UsageError(f"{chart.name}: names columns, which are known of trajectories; leave out [columns]")
    export = read_tum_pair(leader, follower)
    source = {"leader_file": leader.name, "follower_file": follower.name}
    return import_export(export, (str(leader), str(follower)), chart, out, source)


def import_export(
    export: Export,
    pair: tuple[str | None, str | None],
    chart: ColumnMap,
    out: Path,
    source: Mapping[str, str],
) -> Imported:
    """Write two of the bodies of an export to the new log ``out``; errors as :func:`import_recording`."""
    tracks = {body.name: body.placements for body in export.bodies}
    what = f"recording {source.get('file', 'of two trajectories')}"
    names = pair_of(list(tracks), *pair, what)
    for role, name in zip(("leader", "follower"), names, strict=True):
        if not np.isfinite(tracks[name]).any():
            raise UsageError(f"{what}: the {role} {name!r} is lost in all rows; name another body")
    up = found_up([tracks[name] for name in names], export.up)
    led, follows = (turned_up(tracks[name], up) for name in names)
    recorded = Recorded(t_ns=export.t_ns, leader=led, follower=follows)
    scenario = at_rate_of(recorded, chart.scenario)
    told = dict(source) | export.details | {"leader": names[0], "follower": names[1]}
    if chart.path is not None:
        told["map"] = chart.path.name
    messages = write_pair(out, recorded, scenario, told)
    facts = [*export.facts, f"{up} up", f"{rate_of(export.t_ns):.4g} Hz"]
    facts.append(f"leader {names[0]!r}, follower {names[1]!r} of {len(tracks)} bodies")
    return imported(recorded, scenario, messages, "; ".join(facts), export.damage)
