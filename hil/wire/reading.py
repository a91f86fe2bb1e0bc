"""Reading what comes off the wire, for Python: a record, or an error by whose cause it is counted."""

from __future__ import annotations

import functools
from collections.abc import Collection

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.own_motion.odometry_check import OdometrySample
from formation.records import Rows, row_of, rows_of
from hil.errors import AbreastError
from hil.wire import message_types as msg
from hil.wire.cdr import packed_texts
from hil.wire.message_checks import ANY_TIME_NS, Cause
from hil.wire.messages import in_little_endian
from hil.wire.records import Body, Frame, FrameHead, Sighting, Wanted


class RefusedError(AbreastError):
    """An input that is not used; ``cause`` is the name it is counted by."""

    def __init__(self, cause: str) -> None:
        super().__init__(cause)
        self.cause = cause


class FrameReader:
    """Reads mocap frames in which these bodies are known, each frame once however many pairs look at it.

    ``names``: of the bodies, in whose order they are counted.
    """

    def __init__(self, names: Collection[str]) -> None:
        self.names = tuple(names)
        self.bodies = rows_of(Body, len(names))
        self.heads = rows_of(FrameHead, 1)
        self.packed = packed_texts(self.names)
        self._payload = b""

    def pair(self, leader: str, follower: str, latest_ns: int = ANY_TIME_NS) -> Rows[Wanted]:
        """What a pair wants of a frame; a stamp after ``latest_ns`` lies in the future."""
        return row_of(Wanted(self.names.index(leader), self.names.index(follower), latest_ns))

    def again(self, payload: bytes) -> bool:
        """Whether heads and bodies are of this very payload already; if not, who asks is to read it now."""
        if payload is self._payload and payload:
            return True
        self._payload = payload
        return False

    def read(self, payload: bytes, wanted: Rows[Wanted]) -> Frame:
        """The frame as a pair sees it; its cause tells whether it is used."""
        # Compiled code, loaded where somebody reads by Python: the steps of nodes need none of it.
        from hil.wire import entries

        if self.again(payload):
            return entries.look_again(self.heads, self.bodies, wanted)
        whole = in_little_endian(payload, msg.RigidBodies.__msgtype__)
        return entries.take_frame(whole, self.packed, self.heads, self.bodies, wanted)


def read_frame(
    payload: bytes,
    leader: str,
    follower: str,
    now_ns: int | None = None,
    others: Collection[str] = (),
) -> Frame:
    """Read and check a mocap frame; without ``now_ns`` its stamp may lie in the future.

    ``others``: names of bodies that are known to be there and not looked at.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, unknown_body (it holds strangers only),
    missing_leader, missing_follower, duplicate_body, not_finite, out_of_range, bad_quaternion, tilted (z is
    not up).
    """
    reader, wanted = _pair_reader(leader, follower, frozenset(others))
    if now_ns is not None:
        wanted = reader.pair(leader, follower, now_ns + CLOCK_TOLERANCE_NS)
    frame = reader.read(payload, wanted)
    _refuse(frame.cause)
    return frame


def read_odometry(payload: bytes, now_ns: int) -> OdometrySample:
    """Read and check a robot's own motion.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, not_finite, out_of_range.
    """
    from hil.wire import entries

    whole = in_little_endian(payload, msg.Odometry.__msgtype__)
    motion = entries.take_odometry(whole, now_ns + CLOCK_TOLERANCE_NS)
    _refuse(motion.cause)
    return OdometrySample(motion.stamp_ns, motion.v2, motion.u2, motion.has_pose, motion.pose)


def read_sighting(payload: bytes, now_ns: int) -> Sighting:
    """Read and check a sighting of the leader.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, not_finite, out_of_range, bad_range (not
    above zero).
    """
    from hil.wire import entries

    whole = in_little_endian(payload, msg.RangeBearing.__msgtype__)
    sighting = entries.take_sighting(whole, now_ns + CLOCK_TOLERANCE_NS)
    _refuse(sighting.cause)
    return sighting


@functools.lru_cache(maxsize=8)
def frame_reader(names: frozenset[str]) -> FrameReader:
    """The reader that all who know the same bodies share in a process."""
    return FrameReader(sorted(names))


@functools.lru_cache(maxsize=512)
def _pair_reader(leader: str, follower: str, others: frozenset[str]) -> tuple[FrameReader, Rows[Wanted]]:
    reader = frame_reader(others | {leader, follower})
    return reader, reader.pair(leader, follower)


def _refuse(cause: int) -> None:
    if cause != Cause.ACCEPTED:
        raise RefusedError(Cause(cause).word)
