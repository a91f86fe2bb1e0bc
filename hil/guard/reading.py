"""What a guard reads off the wire."""

from __future__ import annotations

from formation.pose import Motion
from hil.guard.robot_guard import WantedDrive
from hil.wire.cdr import after_text, begin, ends
from hil.wire.drive_layout import read_drive
from hil.wire.records import is_time, ns_of


def read_wanted(payload: bytes) -> WantedDrive | None:
    """A command, ``geometry_msgs/TwistStamped``; None for what is none, or has no time.

    Big-endian payloads are not read: nobody who is to be obeyed sends them.
    """
    drive = read_drive(payload, True)
    if not drive.sound or not is_time(drive.stamp):
        return None
    return WantedDrive(Motion(drive.v, drive.u), ns_of(drive.stamp))


def read_driven(payload: bytes, stamped: bool) -> Motion | None:
    """What a driver is told, by ``TwistStamped`` or ``Twist``; None for what is neither."""
    drive = read_drive(payload, stamped)
    return Motion(drive.v, drive.u) if drive.sound else None


def read_word(payload: bytes) -> str | None:
    """The text of a ``std_msgs/String``, None for what is none."""
    at = begin(payload)
    end = after_text(payload, at) if at > 0 else -1
    return payload[at + 4 : end - 1].decode() if ends(payload, end) else None
