"""What a guard costs a command on its way: `python -m benchmarks.guard_hop`.

A commander, a driver and the router in this process, and `abreast guard` as a process of its own. Commands go
by turns to the guard and straight to the driver; times are from sending to hearing, so that both take in what
the machine and this process add.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

from formation.pose import STANDSTILL, Motion
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

WANTED, TOLD, STRAIGHT = "follower/cmd_vel_wanted", "follower/cmd_vel", "straight"
COMMANDS, SPACING_S, PATIENCE_S = 500, 0.01, 60.0


def send(wire: Wire, topic: str, motion: Motion) -> float:
    """Send a command, and tell when [s]."""
    payload = encode(drive_message(motion, time.time_ns(), "follower", stamped=True))
    now_s = time.perf_counter()
    wire.publish(topic, payload)
    return now_s


def heard_s(wire: Wire, topic: str, motion: Motion, patience_s: float = 1.0) -> float | None:
    """When a command is heard [s], None if it is not."""
    until = time.perf_counter() + patience_s
    while (left := until - time.perf_counter()) > 0.0:
        event = wire.inbox.take(left)
        if event is not None and event.topic == topic and read_drive(event.payload, stamped=True) == motion:
            return time.perf_counter()
    return None


def measured(commander: Wire, driver: Wire) -> dict[str, list[float]]:
    """Times [ms] of commands by the topic on which they come."""
    until = time.monotonic() + PATIENCE_S
    while heard_s(driver, TOLD, STANDSTILL, 0.1) is None and time.monotonic() < until:
        send(commander, WANTED, STANDSTILL)
    # A guard takes a sender that begins with a standstill.
    for _ in range(20):
        send(commander, WANTED, STANDSTILL)
        time.sleep(SPACING_S)
    ways: dict[str, list[float]] = {TOLD: [], STRAIGHT: []}
    for number in range(2 * COMMANDS):
        comes, goes = (TOLD, WANTED) if number % 2 else (STRAIGHT, STRAIGHT)
        motion = Motion(0.1 + 1e-5 * number, 0.0)
        sent_s = send(commander, goes, motion)
        if (at_s := heard_s(driver, comes, motion)) is not None:
            ways[comes].append(1e3 * (at_s - sent_s))
        time.sleep(SPACING_S)
    return ways


def main() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        sessions = [open_session(Endpoints(connect=endpoint)) for _ in range(2)]
        commander, driver = map(Wire, sessions)
        driver.subscribe([TOLD, STRAIGHT])
        given = ["guard", "turtlebot3", "--robot", "follower", "--connect", endpoint]
        guard = subprocess.Popen([sys.executable, "-m", "hil", *given], stderr=subprocess.DEVNULL)
        ways = measured(commander, driver)
        status = Path(f"/proc/{guard.pid}/status").read_text(encoding="utf-8")
        held = next(line for line in status.splitlines() if "VmRSS" in line).split()[1]
        guard.terminate()
        guard.wait()
        for wire in (commander, driver):
            wire.close()
        for session in (*sessions, router):
            close_session(session)
    for topic, name in ((TOLD, "through the guard"), (STRAIGHT, "straight")):
        ranked = sorted(ways[topic])
        middle, late = statistics.median(ranked), ranked[int(0.99 * len(ranked))]
        print(f"{name:18s} median {middle:.2f} ms, p99 {late:.2f} ms, {len(ranked)} of {COMMANDS} heard")
    print(f"the guard, of the whole distribution, holds {int(held) / 1024:.0f} MB")


if __name__ == "__main__":
    main()
