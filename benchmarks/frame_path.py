"""The way of one mocap frame from the wire to the wheel: files, calls, and moves between files.

    python benchmarks/frame_path.py [--list]

A frame of ``turtlebot3`` in lockstep, half a minute after the start, through estimator, controller and robot.
Calls into compiled code count as calls of the file that they are written in. ``--list`` prints every move.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.marked import PLAIN
from hil.lockstep.lockstep import Lockstep
from hil.lockstep.run import make_nodes
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.events import Event

ROOT = Path(__file__).resolve().parent.parent
SETTLED_NS = 30_000_000_000


class Way:
    """Files of ours that are entered, in the order in which that happens."""

    def __init__(self) -> None:
        self.entered: list[str] = []

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            self._enter(frame.f_code.co_filename)
        elif event == "c_call" and (plain := _plain_of(argument)):
            self._enter(plain.__code__.co_filename)

    def _enter(self, file: str) -> None:
        path = Path(file)
        if path.is_relative_to(ROOT) and path != Path(__file__).resolve():
            self.entered.append(str(path.relative_to(ROOT)))

    @property
    def moves(self) -> int:
        """How often the next call is of another file than the one before."""
        return sum(a != b for a, b in zip(self.entered, self.entered[1:], strict=False))


def _plain_of(argument: Any) -> Callable[..., Any] | None:
    try:
        return PLAIN.get(argument)
    except TypeError:
        return None


def frame_way() -> Way:
    """The way of one frame, its answers included."""
    frames: list[Outgoing] = []

    def keep(message: Outgoing, now_ns: int) -> None:
        if message.topic == topics.RIGID_BODIES:
            frames.append(message)

    lockstep = Lockstep(make_nodes(load_scenario("turtlebot3")), keep)
    lockstep.run_until(lockstep.now_ns + SETTLED_NS)
    emulator, estimator, controller = range(3)
    # The next frame, taken out of the loop: what it leads to is followed by hand, and in this order.
    lockstep.sink = lambda message, now_ns: None
    way, now_ns = Way(), lockstep.now_ns
    states, nodes = lockstep.states, lockstep.nodes
    frame = Event(topics.RIGID_BODIES, bytes(_later(frames[-1].payload)))
    sys.setprofile(way)
    try:
        _, estimates = nodes[estimator].step(states[estimator], frame, now_ns)
        for estimate in estimates:
            _, commands = nodes[controller].step(
                states[controller], Event(estimate.topic, estimate.payload), now_ns
            )
            for command in commands:
                nodes[emulator].step(states[emulator], Event(command.topic, command.payload), now_ns)
    finally:
        sys.setprofile(None)
    if not estimates:
        raise RuntimeError("the frame led to no estimate; expected one")
    return way


def _later(payload: bytes) -> bytearray:
    """The same frame, captured 8 ms later."""
    later = bytearray(payload)
    nanosec = int.from_bytes(later[8:12], "little") + 8_000_000
    later[8:12] = nanosec.to_bytes(4, "little")
    return later


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    way = frame_way()
    print(f"{len(set(way.entered))} files, {len(way.entered)} calls, {way.moves} moves between files")
    if given.list:
        print("\n".join(way.entered))


if __name__ == "__main__":
    main()
