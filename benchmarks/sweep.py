"""Run-seconds per core-second of the closed loop: compiled, and in Python with filterpy's EKF.

    python benchmarks/sweep.py [--duration 30] [--rounds 5]

Both fly the scenario ``turtlebot3`` with the same seed, from start barrier to stop, in this one process; the
two take turns, and the figures are medians of processor time. The peer is the nodes themselves in lockstep
with ``ekf-filterpy``. They are spared all that a loop in one process would not do: messages are handed on as
objects (nothing is encoded, decoded or hashed), and nothing is logged. The compiled side includes drawing its
random numbers. Neither is judged here; ``judged`` adds that to the compiled side.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.own_motion.inputs import MotionSample

from hil.emulator import node as emulator
from hil.lockstep.flyer import Flyer
from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.lockstep.run import START_TIMEOUT_NS, make_nodes
from hil.nodes import controller, estimator
from hil.nodes import node as nodes
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.sweep.tally import judge_run, orbit_of
from hil.wire import drive_message
from hil.wire import message_types as msg
from hil.wire.message_checks import ANY_TIME_NS, check_frame
from hil.wire.messages import to_ns
from hil.wire.records import Body, Frame, FrameHead, Placement, Stamp, Wanted

SEED = 1


def frame_of(message: msg.RigidBodies, *_: object, **__: object) -> Frame:
    """A frame that is an object already, leader first."""
    bodies: Any = [Body(1, _placement(body.pose)) for body in message.rigidbodies]
    stamp = Stamp(message.header.stamp.sec, message.header.stamp.nanosec)
    head = FrameHead(True, stamp, message.frame_number, 0)
    return check_frame(head, bodies, Wanted(0, 1, ANY_TIME_NS))


def _placement(pose: msg.Pose) -> Placement:
    p, q = pose.position, pose.orientation
    return Placement(p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def motion_of(message: msg.Odometry, now_ns: int) -> MotionSample:
    twist = message.twist.twist
    return MotionSample(to_ns(message.header.stamp), twist.linear.x, twist.angular.z)


@contextmanager
def messages_as_objects() -> Iterator[None]:
    """Hand messages on as they are: what is encoded, decoded and hashed elsewhere is skipped."""

    def same(payload: Any, *_: object) -> Any:
        return payload

    receipt = msg.Consumed(0, msg.Time(0, 0))
    with (
        patch.object(nodes, "encode", same),
        patch.object(estimator, "read_frame", frame_of),
        patch.object(estimator, "read_odometry", motion_of),
        patch.object(drive_message, "decode", same),
        patch.object(controller, "decode_as", same),
        patch.object(emulator, "decode_as", same),
        patch.object(controller, "consumed", lambda event, now_ns: receipt),
        patch.object(estimator, "consumed", lambda event, now_ns: receipt),
    ):
        yield


def fly_in_python(scenario: Scenario) -> list[tuple[float, float]]:
    """The peer's run, and the commands that the follower got."""
    sent: list[tuple[float, float]] = []

    def keep(message: Outgoing, now_ns: int) -> None:
        if message.topic == "follower/command":
            command: Any = message.payload
            sent.append((command.v2, command.u2))

    with messages_as_objects():
        loop = Lockstep(make_nodes(scenario), keep)
        while (since_ns := loop.state_of("emulator").motion_since_ns) is None:
            loop.run_until(loop.now_ns + 10_000_000)
            assert loop.now_ns < EPOCH_NS + START_TIMEOUT_NS
        loop.run_until(since_ns + round(scenario.run.duration_s * 1e9))
    return sent


def seconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    options = [f"run.duration_s={given.duration}", f"run.seed={SEED}"]
    peer = load_scenario("turtlebot3", [*options, "estimator.kind=ekf-filterpy"])
    ours = load_scenario("turtlebot3", [*options, "estimator.kind=ekf"])
    flyer = Flyer(ours, after_s=0.0)
    flown = flyer.fly(SEED).commands["command"]
    commands = np.array(fly_in_python(peer))
    gap = np.abs(commands - np.column_stack([flown["v"], flown["u"]])[: len(commands)])
    print(f"the same loop: commands differ by at most {gap.max():.1e}")
    orbit = orbit_of(ours)

    def judged() -> None:
        judge_run(ours, flyer.fly(SEED), None, orbit)

    took = []
    for _ in range(given.rounds):
        python = seconds(lambda: fly_in_python(peer))
        compiled = np.median([seconds(lambda: flyer.fly(SEED)) for _ in range(50)])
        took.append((python, compiled, np.median([seconds(judged) for _ in range(20)])))
    speeds = given.duration / np.array(took)
    python, compiled, with_judge = np.median(speeds, axis=0)
    ratio = float(np.median(speeds[:, 1] / speeds[:, 0]))
    print(
        f"run-seconds per core-second: Python {python:.1f}, compiled {compiled:.0f}, judged {with_judge:.0f}"
    )
    print(f"ratio {ratio:.0f} (target 1000)")


if __name__ == "__main__":
    main()
