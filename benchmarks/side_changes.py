"""A thousand runs in which the follower is told to change sides at random instants: how near it comes.

    python benchmarks/side_changes.py [--runs 1000] [--share 0.4]

Each run starts near the station, with a leader whose turn rate wanders at random within a share of v1 / rho_0
and ends straight; one to five orders fall at any time of the wandering, and begin when the controller daemon
would let them. Commands are held for 50 ms. Half of the runs know the leader's turn rate (Prop. 1), half
don't (Prop. 2). Needed with the share that the follower can make up for, 0.4: distance > rho_0 / 2
throughout, and the pair settled at the end.
"""

from __future__ import annotations

import argparse
import sys
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.side_change_trial import SETTINGS, Result, Setting, random_run
from controllers.side_change import CORRECTION


def _one(task: tuple[Setting, int, bool, float]) -> Result:
    setting, seed, knows_turn, share = task
    return random_run(setting, seed, knows_turn=knows_turn, share=share)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--share", type=float, default=CORRECTION, help="largest rho_0 |u1| of leaders [v1]")
    given = parser.parse_args()
    each = max(1, given.runs // 4)
    print(
        f"{'setting':14}{'knows u1':>9}{'runs':>6}{'nearest [rho_0]':>17}{'collisions':>12}{'unsettled':>11}"
    )
    with Pool() as pool:
        for setting in SETTINGS:
            for knows_turn in (True, False):
                tasks = [(setting, seed, knows_turn, given.share) for seed in range(each)]
                results = pool.map(_one, tasks, chunksize=4)
                near = [result.nearest for result in results]
                lost = sum(not result.settled for result in results)
                close = sum(value <= 0.5 for value in near)
                print(
                    f"{setting.name:14}{knows_turn!s:>9}{each:6}{min(near):17.3f}{close:12}{lost:11}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
