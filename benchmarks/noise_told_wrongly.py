"""What it costs to tell the estimator a wrong noise of the motion capture, given and estimated.

    python benchmarks/noise_told_wrongly.py [--seeds 30] [--duration 30] [--since 5] [FACTOR ...]

The scenario ``turtlebot3`` in the compiled loop, true noise FACTOR times (1, 3, 10, 1/3, 1/10 by default)
what the estimator is told. Printed for the filter told rightly, the one that takes what it is told, and the
one that finds the noise: RMSE of v1 and alpha1 over tracking estimates, and each over that of the filter told
rightly, share of estimates that track, share of errors beyond five of the estimate's own standard deviations,
mean NIS (ideal 2), scale of the noise of positions and of headings at the end. Judged from ``--since`` on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.tracking.tracker import TRACKING
from formation.angles import wrap
from formation.records import columns_of
from hil.lockstep.flyer import Flown, Flyer
from hil.scenario.files import load_scenario

SCENARIO = "turtlebot3"
FACTORS = (1.0, 3.0, 10.0, 1.0 / 3.0, 0.1)


class Score(NamedTuple):
    """Of all seeds: RMSE, shares, mean NIS, and the mean scales at the end."""

    v1: float
    alpha1: float
    tracked: float
    beyond_v1: float
    beyond_alpha1: float
    nis: float
    position: float
    heading: float


def errors(flown: Flown, from_ns: int, to_ns: int) -> NDArray[np.float64]:
    """Rows of v1's error and deviation, alpha1's error and deviation, NIS, and whether it tracks."""
    estimates, truth = flown.estimates["estimate"], flown.truth
    at_ns = truth["at_ns"]
    row = np.clip(np.searchsorted(at_ns, estimates["capture_ns"]), 0, len(at_ns) - 1)
    judged = (
        (at_ns[row] == estimates["capture_ns"])
        & (estimates["capture_ns"] >= from_ns)
        & (estimates["capture_ns"] <= to_ns)
    )
    leader, follower = truth["leader"][row], truth["follower"][row]
    sight = np.arctan2(follower["y"] - leader["y"], follower["x"] - leader["x"]) - leader["theta"]
    rows = np.column_stack(
        [
            estimates["v1"] - truth["leader_motion"]["v"][row],
            np.sqrt(estimates["joint"]["v_v"]),
            wrap(estimates["alpha1"] - sight),
            np.sqrt(estimates["joint"]["b_b"]),
            estimates["nis"],
            estimates["status"] == TRACKING,
        ]
    )
    found: NDArray[np.float64] = rows[judged]
    return found


def score(overrides: Mapping[str, object], seeds: int, since: float) -> Score:
    """Fly the seeds of a scenario."""
    scenario = load_scenario(SCENARIO, overrides)
    flyer, rows, scales = Flyer(scenario), [], []
    for seed in range(1, seeds + 1):
        flown = flyer.fly(seed)
        begin_ns = flown.since_ns
        to_ns = begin_ns + round(scenario.run.duration_s * 1e9)
        rows.append(errors(flown, begin_ns + round(since * 1e9), to_ns))
        scale = columns_of(flyer.rooms.knowns)["noise"]["scale"][0]
        scales.append((float(scale["position"]), float(scale["heading"])))
    every = np.concatenate(rows)
    kept = every[every[:, 5] > 0.0]
    v1, sd_v1, alpha1, sd_alpha1, nis, _ = kept.T
    position, heading = np.mean(scales, axis=0).tolist()
    return Score(
        float(np.sqrt(np.mean(v1 * v1))),
        float(np.sqrt(np.mean(alpha1 * alpha1))),
        len(kept) / len(every),
        float(np.mean(np.abs(v1) > 5.0 * sd_v1)),
        float(np.mean(np.abs(alpha1) > 5.0 * sd_alpha1)),
        float(np.nanmean(nis)),
        position,
        heading,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("factors", nargs="*", type=float, default=FACTORS, metavar="FACTOR")
    parser.add_argument("--seeds", type=int, default=30, help="runs in each row (default 30)")
    parser.add_argument("--duration", type=float, default=30.0, help="seconds of each (default 30)")
    parser.add_argument("--since", type=float, default=5.0, help="seconds that are not judged (default 5)")
    given = parser.parse_args()
    told = load_scenario(SCENARIO).estimator
    print(f"{given.seeds} runs of {given.duration:g} s, judged from {given.since:g} s on")
    print(" true/told  noise      v1 mm/s        alpha1 rad      tracked  beyond 5 sd     NIS  scale")
    for factor in given.factors or FACTORS:
        sigmas = {
            "sigma_position": factor * told.sigma_position,
            "sigma_heading": factor * told.sigma_heading,
        }
        true = {f"mocap.{key}": sigma for key, sigma in sigmas.items()} | {"run.duration_s": given.duration}
        rightly = {f"estimator.{key}": sigma for key, sigma in sigmas.items()} | {"estimator.noise": "given"}
        best: Score | None = None
        for name, overrides in (
            ("rightly", rightly),
            ("given", {"estimator.noise": "given"}),
            ("estimated", {"estimator.noise": "estimated"}),
        ):
            found = score({**true, **overrides}, given.seeds, given.since)
            best = best or found
            print(
                f"{factor:10.3g}  {name:9} {1e3 * found.v1:7.2f} ({found.v1 / best.v1:6.2f}) "
                f"{found.alpha1:8.4f} ({found.alpha1 / best.alpha1:5.2f}) {found.tracked:8.3f} "
                f"{found.beyond_v1:6.4f} {found.beyond_alpha1:6.4f} {found.nis:7.2f}  "
                f"{found.position:5.2f} {found.heading:5.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
