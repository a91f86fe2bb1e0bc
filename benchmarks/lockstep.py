"""Seconds of a run per second of wall clock in lockstep, with the compiled EKF and with filterpy's.

    python benchmarks/lockstep.py [--duration 10] [--repeats 3]

The scenario ``turtlebot3`` from start barrier to standstill, log included; the two take turns.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from hil.lockstep.run import run_lockstep
from hil.scenario.files import load_scenario

KINDS = ("ekf", "ekf-filterpy")


def speed(kind: str, duration: float) -> float:
    scenario = load_scenario("turtlebot3", [f"estimator.kind={kind}", f"run.duration_s={duration}"])
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        run_lockstep(scenario, Path(folder) / "run.mcap")
        return duration / (time.perf_counter() - begin)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    for kind in KINDS:
        speed(kind, 1.0)
    print("run-seconds per second   " + "   ".join(f"{kind:>12}" for kind in KINDS) + "   ratio")
    for repeat in range(given.repeats):
        ekf, filterpy = (speed(kind, given.duration) for kind in KINDS)
        print(f"repeat {repeat + 1:<16}   {ekf:12.1f}   {filterpy:12.1f}   {ekf / filterpy:5.2f}")


if __name__ == "__main__":
    main()
