"""Run-seconds per core-second of the closed loop: compiled, and in Python with filterpy's EKF.

    python benchmarks/sweep.py [--duration 30] [--rounds 5]

Both fly the scenario ``turtlebot3`` with the same seed, from start barrier to stop, in this one process; the
two take turns, and the figures are medians of processor time. The peer is the nodes themselves in lockstep
with ``ekf-filterpy``, messages included; nothing is logged. The compiled side includes drawing its random
numbers. Neither is judged here; ``judged`` adds that to the compiled side.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from hil.lockstep.flyer import Flyer
from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.lockstep.run import START_TIMEOUT_NS, make_nodes
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.sweep.tally import judge_run, orbit_of
from hil.wire import message_types as msg
from hil.wire.messages import decode_as

SEED = 1


def fly_in_python(scenario: Scenario) -> list[tuple[float, float]]:
    """The peer's run, and the commands that the follower got."""
    sent: list[tuple[float, float]] = []

    def keep(message: Outgoing, now_ns: int) -> None:
        if message.topic == "follower/command":
            command = decode_as(message.payload, msg.Command)
            sent.append((command.v2, command.u2))

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
