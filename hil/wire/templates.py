"""Messages prepared once per node: names and frames stand in them, kernels put in the numbers.

Each is made by the general codec from an empty message, so that it cannot differ from what that would write.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from formation.records import Buffer, Indices
from hil.wire import message_types as msg
from hil.wire.cdr import HEAD_BYTES, PLACEMENT_BYTES, STAMP_BYTES, aligned
from hil.wire.messages import encode, header

_RECEIPT_BYTES = 16
_LONGEST_TEXT_BYTES = 256
_NONE = np.zeros(36)
_NO_TIME = msg.Time(sec=0, nanosec=0)


class Template(NamedTuple):
    """A message to be filled: its bytes, with room for what may grow, and where its numbers begin."""

    buffer: Buffer
    numbers_at: int

    def payload(self, length: int) -> bytes:
        """The message, of which a kernel said that it has this length."""
        return self.buffer[:length].tobytes()


class FrameTemplate(NamedTuple):
    """A mocap frame to be filled: its bytes, and where frame number and poses lie."""

    buffer: Buffer
    places_at: Indices


def frame_template(frame_id: str, names: Sequence[str]) -> FrameTemplate:
    """Frame with bodies of these names, without markers."""
    bodies = [msg.RigidBody(name, [], _no_pose()) for name in names]
    payload = encode(msg.RigidBodies(header(0, frame_id), 0, bodies))
    places = [_after_header(frame_id, 4)]
    at = places[0] + 8
    for name in names:
        # The name, then the number of its markers, then its pose.
        places.append(aligned(aligned(aligned(at, 4) + _length(name), 4) + 4, 8))
        at = places[-1] + PLACEMENT_BYTES
    return FrameTemplate(_buffer(payload), np.array(places, dtype=np.int64))


def odometry_template(frame_id: str, child_frame_id: str) -> Template:
    """Odometry without covariances."""
    message = msg.Odometry(
        header=header(0, frame_id),
        child_frame_id=child_frame_id,
        pose=msg.PoseWithCovariance(pose=_no_pose(), covariance=_NONE),
        twist=msg.TwistWithCovariance(twist=_no_twist(), covariance=_NONE),
    )
    return Template(
        _buffer(encode(message)), aligned(_after_header(frame_id, 4) + _length(child_frame_id), 8)
    )


def drive_template(frame_id: str, *, stamped: bool) -> Template:
    """Drive command: ``TwistStamped`` or ``Twist``."""
    if not stamped:
        return Template(_buffer(encode(_no_twist())), HEAD_BYTES)
    message = msg.TwistStamped(header=header(0, frame_id), twist=_no_twist())
    return Template(_buffer(encode(message)), _after_header(frame_id, 8))


def estimate_template(frame_id: str, most_receipts: int) -> Template:
    """Estimate with room for a reason and so many receipts."""
    times, numbers = [_NO_TIME, _NO_TIME], [0.0] * 9
    fields: list[Any] = [*times, *numbers, np.zeros(25), 0.0, 0, "", 0.0, 0.0, 0.0, []]
    empty = msg.LeaderEstimate(header(0, frame_id), *fields)
    return Template(_buffer(encode(empty), most_receipts), _after_header(frame_id, 4))


def command_template(frame_id: str, most_receipts: int) -> Template:
    """Decision of a controller with room for a reason to stop and so many receipts."""
    empty = msg.Command(header(0, frame_id), _NO_TIME, _NO_TIME, 0.0, 0.0, 0.0, 0.0, False, "", False, [])
    return Template(_buffer(encode(empty), most_receipts), _after_header(frame_id, 4))


def truth_template(frame_id: str) -> Template:
    """True states of a pair."""
    empty = msg.Truth(header(0, frame_id), 0, *[0.0] * 10)
    return Template(_buffer(encode(empty)), _after_header(frame_id, 4))


def _buffer(payload: bytes, most_receipts: int | None = None) -> Buffer:
    more = 0 if most_receipts is None else _LONGEST_TEXT_BYTES + _RECEIPT_BYTES * (most_receipts + 1)
    buffer = np.zeros(len(payload) + more, dtype=np.uint8)
    buffer[: len(payload)] = np.frombuffer(payload, dtype=np.uint8)
    return buffer


def _length(text: str) -> int:
    """Bytes that a string takes, its length and the zero at its end included."""
    return 5 + len(text.encode())


def _after_header(frame_id: str, width: int) -> int:
    """Where a field of a width lies that comes next after a header."""
    return aligned(HEAD_BYTES + STAMP_BYTES + _length(frame_id), width)


def _no_pose() -> msg.Pose:
    nowhere = msg.Point(x=0.0, y=0.0, z=0.0)
    return msg.Pose(position=nowhere, orientation=msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0))


def _no_twist() -> msg.Twist:
    return msg.Twist(linear=msg.Vector3(x=0.0, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=0.0))
