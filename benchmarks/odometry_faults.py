"""How far the driven pair strays when the follower's odometry fails, and whether that is named.

    python benchmarks/odometry_faults.py [--seeds 20] [--own-motion auto] [--set KEY=VALUE ...] [FAULT ...]

The scenario ``turtlebot3``, 30 s; each fault begins 10 s after the leader set off and lasts. Printed:
deviation of rho [mm] and alpha1 [deg] from the noise-free run, root of the mean square over 15 to 30 s, of
the median run and of the worst; and what the estimator says of odometry in the end, in how many runs.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.records import columns_of, load
from hil.lockstep.flyer import Flyer
from hil.nodes.estimator_memory import rules_of
from hil.nodes.estimator_records import Known
from hil.nodes.odometry_findings import odometry_findings
from hil.scenario.files import load_scenario
from hil.sweep.tally import judge_run, orbit_of

FAULTS: Mapping[str, str] = {
    "none": "",
    "silent": 'kind="silent"',
    "nan": 'kind="nan"',
    "zero": 'kind="zero"',
    "reversed": 'kind="reversed"',
    "scale 1.3": 'kind="scale", factor=1.3',
    "scale 0.7": 'kind="scale", factor=0.7',
    "scale 1e-6": 'kind="scale", factor=1e-6',
    "delay 0.1 s": 'kind="delay", delay_s=0.1',
    "delay 0.25 s": 'kind="delay", delay_s=0.25',
    "delay 0.5 s": 'kind="delay", delay_s=0.5',
    "slip 0.2": 'kind="slip", factor=0.2',
    "slip 0.5": 'kind="slip", factor=0.5',
    "reset": 'kind="reset"',
    "commands": 'kind="commands"',
}


def row(name: str, seeds: int, settings: list[str]) -> str:
    """One line of the table."""
    fault = FAULTS[name]
    faults = f"robot.odometry_faults=[{{{fault}, at_s=10.0}}]" if fault else "robot.odometry_faults=[]"
    scenario = load_scenario("turtlebot3", [*settings, faults])
    orbit = orbit_of(load_scenario("turtlebot3", settings))
    flyer, rules = Flyer(scenario, after_s=0.0), rules_of(scenario)
    off: list[tuple[float, float]] = []
    found: Counter[str] = Counter()
    for seed in range(1, seeds + 1):
        flown = flyer.fly(seed)
        tally = judge_run(scenario, flown, None, orbit)[0]
        moments = tally["moments"]
        off.append((math.sqrt(tally["rho_off_sum"] / moments), math.sqrt(tally["alpha1_off_sum"] / moments)))
        known = load(Known, flyer.rooms.knowns, 0)
        end_ns = int(columns_of(flyer.rooms.truth)["at_ns"][len(flown.truth) - 1])
        found.update(f"{what}: {text}" for what, text in odometry_findings(known, rules, end_ns).items())
    rho, alpha1 = np.array(off).T
    words = "; ".join(f"{text} ({count})" for text, count in found.most_common(3)) or "-"
    return (
        f"{name:14s}{np.median(rho) * 1e3:8.2f}{rho.max() * 1e3:8.2f}"
        f"{np.degrees(np.median(alpha1)):8.2f}{np.degrees(alpha1.max()):8.2f}   {words}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--own-motion", default="auto")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("faults", nargs="*", default=list(FAULTS), metavar="FAULT")
    given = parser.parse_args()
    print(f"{'fault':14s}{'rho, mm':>8s}{'worst':>8s}{'a1, deg':>8s}{'worst':>8s}   found in the end")
    for name in given.faults:
        print(row(name, given.seeds, [f"estimator.own_motion={given.own_motion}", *given.set]), flush=True)


if __name__ == "__main__":
    main()
