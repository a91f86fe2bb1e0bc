"""Strangers on a lab's wire, as processes: ``python -m hil.faults.stranger KIND ENDPOINT SECONDS [HZ]``."""

from __future__ import annotations

import struct
import sys
import time
from collections.abc import Callable, Sequence

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.message_types import Message, String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session

FAST = Motion(0.2, 2.0)
WANTED, TOLD = "follower/cmd_vel_wanted", "follower/cmd_vel"
_STAMP = struct.Struct("<iI")
_STAMP_AT = 4
_ELSEWHERE = Pose(5.0, 5.0, 0.0)


def _command() -> Message:
    return drive_message(FAST, time.time_ns(), "follower", stamped=True)


def _odometry() -> Message:
    return odometry_message(time.time_ns(), "follower", _ELSEWHERE, FAST)


def _frame() -> Message:
    return frame_message(time.time_ns(), 1, [("leader", _ELSEWHERE), ("follower", _ELSEWHERE)])


def _stop() -> Message:
    return String(data="a stranger says so")


SAID: dict[str, tuple[str, Callable[[], Message], bool]] = {
    "forged-wanted": (WANTED, _command, False),
    "forged-told": (TOLD, _command, False),
    "second-controller": (WANTED, _command, True),
    "stop": (topics.STOP, _stop, False),
    "flood-commands": (WANTED, _command, True),
    "flood-odometry": ("follower/odom", _odometry, True),
    "flood-frames": (topics.RIGID_BODIES, _frame, True),
}
"""By the name of a stranger: where it speaks, what it says, and whether it says who it is."""


def speak(kind: str, endpoint: str, seconds: float, hz: float) -> int:
    """Say it for a while; how often it was said. The first thing is told on stdout when it is said."""
    topic, make, signed = SAID[kind]
    session = open_session(Endpoints(connect=endpoint), 30.0)
    wire = Wire(session)
    payload = bytearray(encode(make()))

    def put(said: bytes) -> None:
        if signed:
            wire.publish(topic, said)
        else:
            session.put(topic, said)

    begun, said = time.monotonic(), 0
    sys.stdout.write(f"{begun!r}\n")
    sys.stdout.flush()
    while (now := time.monotonic()) < begun + seconds or said == 0:
        if topic != topics.STOP:
            _STAMP.pack_into(payload, _STAMP_AT, *divmod(time.time_ns(), 1_000_000_000))
        put(bytes(payload))
        said += 1
        if (left := begun + said / hz - now) > 0.0:
            time.sleep(left)
    time.sleep(0.2)
    wire.close()
    close_session(session)
    return said


def main(arguments: Sequence[str]) -> None:
    """Be a stranger."""
    kind, endpoint, seconds = arguments[0], arguments[1], float(arguments[2])
    hz = float(arguments[3]) if len(arguments) > 3 else 50.0
    sys.stdout.write(f"{speak(kind, endpoint, seconds, hz)}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
