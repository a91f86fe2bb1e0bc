"""Drive commands on the wire: ``TwistStamped``, or ``Twist`` for robots that take no stamp."""

from __future__ import annotations

from formation.pose import Motion
from hil.wire import message_types as msg
from hil.wire.messages import MalformedPayloadError, header, in_little_endian, typename_of


def drive_message(motion: Motion, stamp_ns: int, frame_id: str, *, stamped: bool) -> msg.Message:
    """Message that tells a robot to drive: speed along x, turn rate about z."""
    twist = msg.Twist(
        linear=msg.Vector3(x=motion.v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=motion.u)
    )
    return msg.TwistStamped(header=header(stamp_ns, frame_id), twist=twist) if stamped else twist


def drive_type(*, stamped: bool) -> str:
    """Name of the type of drive commands."""
    return typename_of(msg.TwistStamped if stamped else msg.Twist)


def read_drive(payload: bytes, *, stamped: bool) -> Motion:
    """Motion that a drive command asks for, not judged.

    Raises :class:`~hil.wire.messages.MalformedPayloadError` for a payload that is none.
    """
    # Compiled code, loaded where somebody reads: writing needs none of it.
    from hil.wire import entries

    kind = drive_type(stamped=stamped)
    drive = entries.read_drive(in_little_endian(payload, kind), stamped)
    if not drive.sound:
        raise MalformedPayloadError(f"{len(payload)} bytes, expected a {kind}")
    return Motion(drive.v, drive.u)
