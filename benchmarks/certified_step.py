"""What certified estimates add to the estimator's step: the same frames with and without, interleaved.

    python benchmarks/certified_step.py [--seconds 20]

The frames and odometry are those of a run in lockstep. A step is all that the node does with a frame, from
its payload to the encoded messages. Times are those of the processor, so that a busy machine does not count.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from hil.lockstep.run import run_lockstep
from hil.log.events import Timed, logged_events
from hil.log.reader import read_log
from hil.nodes.estimator import EstimatorNode
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario
from hil.wire import topics

WARM_UP = 300  # frames


def recorded(seconds: float) -> list[Timed]:
    """What the estimator of a run took in."""
    given = load_scenario("turtlebot3", [f"run.duration_s={seconds}"])
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "run.mcap"
        run_lockstep(given, log)
        return list(logged_events(read_log(log), EstimatorNode(given).subscribes))


def seconds_of_steps(events: list[Timed]) -> dict[str, list[float]]:
    """Processor time of every step with a frame, without and with certified estimates."""
    nodes = {
        "without": EstimatorNode(load_scenario("turtlebot3")),
        "with": EstimatorNode(load_scenario("turtlebot3", [CERTIFY])),
    }
    states = {name: node.begin(events[0][1]) for name, node in nodes.items()}
    took: dict[str, list[float]] = {name: [] for name in nodes}
    for event, now_ns in events:
        for name, node in nodes.items():
            begin = time.thread_time_ns()
            states[name], _ = node.step(states[name], event, now_ns)
            if event.topic == topics.RIGID_BODIES:
                took[name].append(1e-9 * (time.thread_time_ns() - begin))
    return took


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    events = recorded(parser.parse_args().seconds)
    gc.freeze()
    for name, took in seconds_of_steps(events).items():
        p50, p99 = 1e6 * np.percentile(took[WARM_UP:], [50.0, 99.0])
        print(f"{name:8} {len(took) - WARM_UP} frames  p50 {p50:5.0f} us  p99 {p99:5.0f} us")


if __name__ == "__main__":
    main()
