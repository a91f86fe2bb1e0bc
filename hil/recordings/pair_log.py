"""Writing what a recording has of a pair as a log, as if it had come over the wire: whole columns at once."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.emulator.lab_messages import MOCAP_FRAME, odometry_frames
from hil.log.described_log import DescribedLog
from hil.log.metadata import IMPORT, certificate_metadata, log_metadata
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.cdr import HEAD_BYTES
from hil.wire.messages import encode, header, typename_of
from hil.wire.topics import topics_of

Times = NDArray[np.int64]

TRUTH = (
    "leader_x", "leader_y", "leader_theta", "v1", "u1",
    "follower_x", "follower_y", "follower_theta", "v2", "u2",
)  # fmt: skip
"""What is told of the true states, in the order of the columns of :attr:`Recorded.truth`."""

_NS_PER_S = 1_000_000_000
_CHUNK_S = 2.0  # nothing is lost with an import that is ended: it can be done again
_AT_ONCE = 4096  # rows whose messages are made together: a few megabytes
_MARK = 1e300
_NUMBER = 0x5EAFA11


class Recorded(NamedTuple):
    """Rows of a recording at increasing times, each with what is known then; rows of NaN where it is not.

    ``t_ns``: (n,). ``leader``, ``follower``: (n, 7) position [m] and quaternion x, y, z, w, z up.
    ``motion``: (n, 2) v2 [m/s], u2 [rad/s]. ``sighting``: (n, 2) rho [m], alpha2 [rad].
    ``truth``: (n, 10) as :data:`TRUTH`, NaN where unknown.
    ``commanded``: the motion of a row was told after its measurement.
    """

    t_ns: Times
    leader: FloatArray | None = None
    follower: FloatArray | None = None
    motion: FloatArray | None = None
    sighting: FloatArray | None = None
    truth: FloatArray | None = None
    commanded: bool = False


class _Stream(NamedTuple):
    """Messages of one kind: the rows that have one, and what to write."""

    topic: str
    typename: str
    rows: NDArray[np.int64]
    payloads: Iterator[bytes]


def write_pair(out: Path, recorded: Recorded, scenario: Scenario, source: Mapping[str, str]) -> int:
    """Write the rows to the new log ``out``; the number of messages. ``source``: metadata on the recording.

    Stamps are the recording's own times. Raises :class:`UsageError` if ``out`` exists or cannot be created.
    No half log is left behind.
    """
    metadata = log_metadata(scenario, IMPORT) | certificate_metadata(
        certificate_json(certificate_of(scenario, driven=False))
    )
    metadata["source"] = dict(source)
    with DescribedLog(out, metadata, _CHUNK_S) as log:
        try:
            for topic, typename, payload, t_ns in _in_order(recorded, _streams(recorded, scenario)):
                log.write(topic, typename, payload, t_ns, t_ns)
        except BaseException:
            out.unlink(missing_ok=True)
            raise
    return log.messages


def known_rows(values: FloatArray) -> NDArray[np.bool_]:
    """Whether each row of ``values`` (n, k) is known: has no NaN."""
    return np.asarray(np.isfinite(values).all(axis=1), dtype=np.bool_)


def planar_placements(x: FloatArray, y: FloatArray, theta: FloatArray) -> FloatArray:
    """Poses (n, 7) of what stands on the ground, of its x, y [m] and heading [rad], each (n,)."""
    zero = np.zeros_like(x)
    # numpy's own sine differs between machines in the last bit.
    half = [0.5 * angle for angle in theta.tolist()]
    return np.column_stack([x, y, zero, zero, zero, _each(math.sin, half), _each(math.cos, half)])


def _each(function: Callable[[float], float], values: Sequence[float]) -> FloatArray:
    return np.array([function(value) for value in values], dtype=np.float64)


def _in_order(recorded: Recorded, streams: Sequence[_Stream]) -> Iterator[tuple[str, str, bytes, int]]:
    """Messages of all streams by row, those of one row in the order of the streams."""
    rows = np.concatenate([stream.rows for stream in streams])
    which = np.repeat(np.arange(len(streams)), [len(stream.rows) for stream in streams])
    order = np.lexsort((which, rows))
    times = recorded.t_ns[rows[order]].tolist()
    for number, t_ns in zip(which[order].tolist(), times, strict=True):
        stream = streams[number]
        yield stream.topic, stream.typename, next(stream.payloads), t_ns


def _streams(recorded: Recorded, scenario: Scenario) -> list[_Stream]:
    """What there is, in the order in which a robot had it."""
    names = topics_of(scenario)
    measured: list[_Stream] = []
    if recorded.sighting is not None:
        measured.append(_sightings(recorded.t_ns, recorded.sighting, names.follower, names.sighting))
    if recorded.leader is not None or recorded.follower is not None:
        measured += _frames(recorded, names.leader, names.follower)
    moved = [] if recorded.motion is None else [_odometry(recorded.t_ns, recorded.motion, names)]
    streams = [*measured, *moved] if recorded.commanded else [*moved, *measured]
    if recorded.truth is not None:
        streams.append(_truth(recorded.t_ns, recorded.truth))
    return streams


def _sightings(t_ns: Times, values: FloatArray, follower: str, topic: str) -> _Stream:
    stamp = header(0, follower)
    return _stream(topic, lambda mark, _: msg.RangeBearing(stamp, *mark), t_ns, values)


def _frames(recorded: Recorded, leader: str, follower: str) -> Iterator[_Stream]:
    """Frames with both bodies, with the leader alone, and with the follower alone."""
    nowhere = np.full((len(recorded.t_ns), 7), np.nan)
    led = nowhere if recorded.leader is None else recorded.leader
    follows = nowhere if recorded.follower is None else recorded.follower
    first, second = known_rows(led), known_rows(follows)
    for names, rows, values in (
        ((leader, follower), np.flatnonzero(first & second), np.hstack([led, follows])),
        ((leader,), np.flatnonzero(first & ~second), led),
        ((follower,), np.flatnonzero(~first & second), follows),
    ):
        if len(rows):
            yield _stream(topics.RIGID_BODIES, _frame_of(names), recorded.t_ns, values, rows)


def _frame_of(names: Sequence[str]) -> Callable[[list[float], int], msg.Message]:
    def frame(mark: list[float], number: int) -> msg.Message:
        bodies = [msg.RigidBody(name, [], _pose(mark[7 * k : 7 * k + 7])) for k, name in enumerate(names)]
        return msg.RigidBodies(header(0, MOCAP_FRAME), number, bodies)

    return frame


def _odometry(t_ns: Times, values: FloatArray, names: topics.Topics) -> _Stream:
    frame_id, child_frame_id = odometry_frames(names.follower)

    def odometry(mark: list[float], _: int) -> msg.Message:
        ahead, none = msg.Vector3(x=mark[0], y=0.0, z=0.0), np.zeros(36)
        twist = msg.Twist(linear=ahead, angular=msg.Vector3(x=0.0, y=0.0, z=mark[1]))
        pose = _pose([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        return msg.Odometry(
            header=header(0, frame_id),
            child_frame_id=child_frame_id,
            pose=msg.PoseWithCovariance(pose=pose, covariance=none),
            twist=msg.TwistWithCovariance(twist=twist, covariance=none),
        )

    return _stream(names.odom, odometry, t_ns, values)


def _truth(t_ns: Times, values: FloatArray) -> _Stream:
    stamp = header(0, "world")
    rows = np.flatnonzero(np.isfinite(values).any(axis=1))
    return _stream(topics.TRUTH, lambda mark, number: msg.Truth(stamp, number, *mark), t_ns, values, rows)


def _pose(numbers: Sequence[float]) -> msg.Pose:
    x, y, z, qx, qy, qz, qw = numbers
    return msg.Pose(position=msg.Point(x=x, y=y, z=z), orientation=msg.Quaternion(x=qx, y=qy, z=qz, w=qw))


def _stream(
    topic: str,
    make: Callable[[list[float], int], msg.Message],
    t_ns: Times,
    values: FloatArray,
    rows: NDArray[np.int64] | None = None,
) -> _Stream:
    """Messages of the rows of ``values``, all of them finite unless ``rows`` says which."""
    if rows is None:
        rows = np.flatnonzero(known_rows(values))
    marks = [_MARK * (1.0 + k / 64.0) for k in range(values.shape[1])]
    pattern = make(marks, _NUMBER)
    payload = encode(pattern)
    places = [payload.index(struct.pack("<d", mark)) for mark in marks]
    number_at = payload.find(struct.pack("<i", _NUMBER))
    return _Stream(
        topic, typename_of(pattern), rows, _payloads(payload, places, number_at, rows, t_ns, values)
    )


def _payloads(
    payload: bytes,
    places: Sequence[int],
    number_at: int,
    rows: NDArray[np.int64],
    t_ns: Times,
    values: FloatArray,
) -> Iterator[bytes]:
    """The pattern with stamp, number of the row and values of each row; bytes stand where marks stood."""
    for first in range(0, len(rows), _AT_ONCE):
        some = rows[first : first + _AT_ONCE]
        block = np.tile(np.frombuffer(payload, dtype=np.uint8), (len(some), 1))
        seconds, rest = np.divmod(t_ns[some], _NS_PER_S)
        _put(block, HEAD_BYTES, seconds.astype("<i4"))
        _put(block, HEAD_BYTES + 4, rest.astype("<u4"))
        if number_at >= 0:
            _put(block, number_at, some.astype("<i4"))
        for place, column in zip(places, values[some].T, strict=True):
            _put(block, place, np.ascontiguousarray(column, dtype="<f8"))
        data, size = block.tobytes(), block.shape[1]
        for k in range(len(some)):
            yield data[k * size : (k + 1) * size]


def _put(block: NDArray[np.uint8], at: int, column: NDArray[np.generic]) -> None:
    width = column.dtype.itemsize
    block[:, at : at + width] = column.view(np.uint8).reshape(-1, width)
