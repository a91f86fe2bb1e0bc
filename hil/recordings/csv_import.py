"""Turning a CSV recording into a log, as if its rows had come over the wire."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.log.described_log import DescribedLog
from hil.log.metadata import IMPORT, certificate_metadata, log_metadata
from hil.recordings.column_map import ColumnMap
from hil.recordings.csv_table import Row, read_table
from hil.scenario.certificate import certificate_json, certificate_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import encode, header, typename_of
from hil.wire.topics import Topics, topics_of


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import gave: rows read, messages written, and the times [s] of the first and the last row.

    ``torn``: number of a last line that was left out because the file ends in it, 0 for none.
    """

    rows: int
    messages: int
    from_s: float
    to_s: float
    torn: int = 0


def import_csv(recording: Path, chart: ColumnMap, out: Path) -> Imported:
    """Write the rows of a CSV file to the new log ``out``. Stamps are the recording's own times.

    Raises :class:`UsageError` as :func:`hil.recordings.csv_table.read_rows`, before anything is written, and
    if ``out`` exists or cannot be created. No half log is left behind.
    """
    rows, torn = read_table(recording, chart)
    names = topics_of(chart.scenario)
    metadata = log_metadata(chart.scenario, IMPORT) | certificate_metadata(
        certificate_json(certificate_of(chart.scenario, driven=False))
    )
    metadata["source"] = {"file": recording.name, "map": chart.path.name}
    with DescribedLog(out, metadata) as log:
        try:
            for number, row in enumerate(rows):
                for topic, message in _messages(number, row, chart, names):
                    log.write(topic, typename_of(message), encode(message), row.t_ns, row.t_ns)
        except BaseException:
            out.unlink(missing_ok=True)
            raise
    return Imported(len(rows), log.messages, rows[0].t_ns * 1e-9, rows[-1].t_ns * 1e-9, torn)


def _messages(number: int, row: Row, chart: ColumnMap, names: Topics) -> Iterator[tuple[str, msg.Message]]:
    """Messages of a row, in the order in which the robot had them."""
    given = row.columns
    measurement: list[tuple[str, msg.Message]] = []
    if "rho" in given:
        measurement = [_sighting(row, names)]
    elif "leader_x" in given or "follower_x" in given:
        measurement = [_frame(number, row, names)]
    motion = [(names.odom, _odometry(row, names))] if "v2" in given else []
    yield from [*measurement, *motion] if chart.commanded else [*motion, *measurement]
    if row.truth:
        yield topics.TRUTH, _truth(number, row)


def _sighting(row: Row, names: Topics) -> tuple[str, msg.Message]:
    stamp = header(row.t_ns, names.follower)
    return names.sighting, msg.RangeBearing(stamp, row.columns["rho"], row.columns["alpha2"])


def _frame(number: int, row: Row, names: Topics) -> tuple[str, msg.Message]:
    given = row.columns
    bodies: list[tuple[str, Pose]] = []
    if "leader_x" in given:
        leader = Pose(given["leader_x"], given["leader_y"], given.get("leader_theta", 0.0))
        bodies.append((names.leader, leader))
    if "follower_x" in given:
        follower = Pose(given["follower_x"], given["follower_y"], given["follower_theta"])
        bodies.append((names.follower, follower))
    return topics.RIGID_BODIES, frame_message(row.t_ns, number, bodies)


def _odometry(row: Row, names: Topics) -> msg.Odometry:
    motion = Motion(row.columns["v2"], row.columns["u2"])
    return odometry_message(row.t_ns, names.follower, Pose(0.0, 0.0, 0.0), motion)


def _truth(number: int, row: Row) -> msg.Truth:
    def known(name: str) -> float:
        return row.truth.get(name, math.nan)

    return msg.Truth(
        header=header(row.t_ns, "world"),
        frame_number=number,
        leader_x=known("leader_x"),
        leader_y=known("leader_y"),
        leader_theta=known("leader_theta"),
        v1=known("v1"),
        u1=known("u1"),
        follower_x=known("follower_x"),
        follower_y=known("follower_y"),
        follower_theta=known("follower_theta"),
        v2=known("v2"),
        u2=known("u2"),
    )
