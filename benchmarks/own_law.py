"""What a law of one's own costs: Prop. 2 as shipped, by a user, and by one whose code cannot be compiled.

    python benchmarks/own_law.py [--duration 30] [--rounds 15]

All three fly the same runs of ``turtlebot3`` in the loop of a sweep and are judged as there, in this one
process and in turns; the figures are medians of processor time. All give the same commands, bit for bit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from hil.lockstep.flyer import Flyer
from hil.scenario.files import load_scenario
from hil.sweep.tally import judge_run, judged_span, orbit_of

LAWS = """
def compiled(shape, leader, gains):
    f = gains.mu_rho * ((shape.rho - gains.rho_0) / shape.rho) * ((shape.rho + gains.rho_0) / shape.rho)
    v2 = -leader.v1 * shape.sin1 + shape.rho * (leader.v1 * f - gains.mu1 * shape.cos1)
    driven = max(-gains.v_max, min(gains.v_max, v2))
    line_rate = (leader.v1 * shape.sin1 + driven * shape.sin2) / shape.rho
    return v2, line_rate - gains.mu2 * shape.cos2

def interpreted(shape, leader, gains):
    import math
    return compiled(shape, leader, gains)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "benchmark_laws.py"
        file.write_text(LAWS)
        laws = {
            "shipped": "independent",
            "compiled": f"{file}:compiled",
            "interpreted": f"{file}:interpreted",
        }
        duration = f"run.duration_s={given.duration}"
        scenarios = {
            name: load_scenario("turtlebot3", [duration, f"controller.law={law}"])
            for name, law in laws.items()
        }
        flyers, orbits = {}, {}
        for name, scenario in scenarios.items():
            flyers[name] = Flyer(scenario, judged_from_ns=judged_span(scenario).from_ns, after_s=0.03)
            orbits[name] = orbit_of(scenario)
    commands = {name: flyer.fly(1).commands.tobytes() for name, flyer in flyers.items()}
    print(f"the same commands, bit for bit: {'yes' if len(set(commands.values())) == 1 else 'NO'}")
    took: dict[str, list[float]] = {name: [] for name in laws}
    for seed in range(given.rounds):
        for name, scenario in scenarios.items():
            begun = time.process_time()
            judge_run(scenario, flyers[name].fly(seed), None, orbits[name])
            took[name].append(time.process_time() - begun)
    for name, times in took.items():
        ratio = np.median(np.array(times) / np.array(took["shipped"]))
        print(f"{name:12} {1e3 * np.median(times):6.1f} ms a run, {ratio:5.2f} of the shipped one's time")


if __name__ == "__main__":
    main()
