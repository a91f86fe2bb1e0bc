"""A controller in a process of its own, 50 commands a second: `python commander.py ENDPOINT V U [ROBOT]`."""

from __future__ import annotations

import sys
import time

from formation.pose import STANDSTILL, Motion
from hil.scenario.files import load_scenario
from hil.wire.drive_message import drive_message
from hil.wire.messages import encode
from hil.wire.pubsub import joined
from hil.wire.session import Endpoints

STANDS_S = 0.5


def main(endpoint: str, v: float, u: float, robot: str = "follower") -> None:
    """Send until the end of time."""
    with joined(Endpoints(connect=endpoint), load_scenario("turtlebot3"), "controller") as wire:
        begun = time.monotonic()
        while True:
            motion = Motion(v, u) if time.monotonic() - begun > STANDS_S else STANDSTILL
            told = drive_message(motion, time.time_ns(), robot, stamped=True)
            wire.publish(f"{robot}/cmd_vel_wanted", encode(told))
            time.sleep(0.02)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), *sys.argv[4:])
