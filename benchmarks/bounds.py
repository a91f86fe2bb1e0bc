"""Do the bounds hold, and the certificate? Random errors against every bound; leaders against the formation.

    python benchmarks/bounds.py [--samples 1000000] [--pairs 10000] [--duration 30] [--seed 1]

First table: over both gain sets of the paper and four noise levels, half of the samples with every error on
the edge of what is allowed, the share of samples that break each bound and the largest error / bound. Exact
inputs: only the rates err, as in the paper's appendix. Input errors: rho, alpha2, v2 and u2 err as well,
which only the extended forms admit. Second table: pairs whose leaders switch their steering between the
limits, by chance or when it hurts, and how close to the edge of the certified set they came.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.adversary import drive_out
from benchmarks.bound_trials import FIG2, LEVELS, TURTLEBOT3, judge_trials
from estimation.bounds.bound_check import QUANTITY_OF
from formation.invariant_set import Disturbed, invariant_set
from formation.speed_range import SpeedRange
from formation.steering_margin import steering_margin

SETTINGS = {"fig2": FIG2, "turtlebot3": TURTLEBOT3}
CHUNK = 250_000
TURNING = {"turtlebot3, k_u = 0.7": (TURTLEBOT3, 0.7), "fig2, k_u = 0.5": (FIG2, 0.5)}


def judge_bounds(samples: int, seed: int) -> None:
    print(f"{'bound':<16} " + " ".join(f"{kind:>28}" for kind in ("exact inputs", "input errors")))
    columns = []
    for input_errors in (False, True):
        violations: Counter[str] = Counter()
        tightness = dict.fromkeys(QUANTITY_OF, 0.0)
        share, judged = samples // (len(SETTINGS) * len(LEVELS)), 0
        for number, setting in enumerate(SETTINGS.values()):
            for level in LEVELS:
                for begin in range(0, share, CHUNK):
                    random = np.random.default_rng([seed, number, round(1000 * level), input_errors, begin])
                    size = min(CHUNK, share - begin)
                    verdict = judge_trials(setting, level, random, size, input_errors=input_errors)
                    violations.update(verdict.violations)
                    tightness = {name: max(tightness[name], verdict.tightness[name]) for name in tightness}
                    judged += size
        columns.append((violations, tightness, judged))
    for name in QUANTITY_OF:
        cells = [
            f"{violations[name]:>9} broken {violations[name] / judged:7.3%}, {tightness[name]:7.4g}"
            for violations, tightness, judged in columns
        ]
        print(f"{name:<16} " + " ".join(f"{cell:>34}" for cell in cells))
    print(f"({columns[0][2]} samples per column; last figure: largest error / bound)")


def challenge(pairs: int, duration: float, seed: int) -> None:
    for name, (setting, k_u) in TURNING.items():
        system = Disturbed(setting.mu1, setting.spacing, SpeedRange(setting.v1, setting.v1), k_u)
        found = invariant_set(system)
        margin = steering_margin(setting.mu1, setting.spacing, setting.v1)
        low, high = math.floor(1e3 * margin.lower) / 1e3, math.ceil(1e3 * margin.upper) / 1e3
        print(f"\n{name}: k_u* between {low:.3f} and {high:.3f} rad/s")
        if found is None:
            print("  no certified set")
            continue
        came = drive_out(system, found, np.random.default_rng(seed), pairs, duration)
        for row, lowest, highest in (
            ("certified", found, found),
            (f"{came.pairs} pairs", came, came),
        ):
            print(
                f"  {row:<14} rho {lowest.rho_min:.5f} to {highest.rho_max:.5f} m, "
                f"alpha1 {lowest.alpha1_min:.5f} to {highest.alpha1_max:.5f} rad"
            )
        print(f"  {came.left} pairs ever left the set")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    begin = time.perf_counter()
    judge_bounds(given.samples, given.seed)
    challenge(given.pairs, given.duration, given.seed)
    print(f"\n{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
