"""Somebody on a wire who says the same again and again, as robots do."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.wire.messages import encode
from hil.wire.pubsub import Wire


@contextmanager
def again(wire: Wire, *said: tuple[str, bytes]) -> Iterator[None]:
    """Somebody who says all of this 50 times a second."""
    over = threading.Event()

    def say() -> None:
        while not over.wait(0.02):
            for topic, payload in said:
                wire.publish(topic, payload)

    saying = threading.Thread(target=say)
    saying.start()
    try:
        yield
    finally:
        over.set()
        saying.join()


def odometry(robot: str, moves: Motion = STANDSTILL) -> tuple[str, bytes]:
    """What a robot says of its motion, and where."""
    return f"{robot}/odom", encode(odometry_message(5, robot, Pose(0.0, 0.0, 0.0), moves))
