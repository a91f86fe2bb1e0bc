"""How well leaders of real recordings are estimated: MRCLAM pairs by every front end, a TurtleBot3 by LiDAR.

    ABREAST_REAL=DIR python benchmarks/recordings.py [--only camera] [--set KEY=VALUE] [--answered] [--each]

The LiDAR has a row as it is, and one with the offsets that ``abreast calibrate`` finds in its first 6.6 s.

One line for each way of measuring, medians over pairs: RMSE of v1 while tracking, that over the RMSE of the
best constant guess (over the same samples, and over all that is known of the leader), median error of alpha1,
correlation of v1 with the truth, share of the measurements of a moving leader at which it is tracked, share
of alpha1 beyond five standard deviations, the mean of e^2 / var of v1 and alpha1, and the mean NIS.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.tracking.estimate import QUANTITIES
from hil.judge.columns import Columns, EstimateColumns, columns_of, inside
from hil.judge.estimation import errors_at
from hil.judge.replay_verdict import run_data_of_replay
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.recordings.column_map import load_column_map
from hil.recordings.csv_import import import_csv
from hil.recordings.mrclam_import import Sightings, import_mrclam
from hil.replay.calibration import calibrate
from hil.replay.rerun import replay
from hil.replay.timing import timing_of
from hil.scenario.files import with_overrides

PAIRS = ((1, 2), (2, 3), (3, 4), (4, 5), (5, 1), (3, 1))
"""Leader and follower, by Vicon."""

CAMERA_PAIRS = ((5, 3), (2, 5), (1, 2), (4, 3), (1, 5), (2, 3))
"""Those whose camera sees the leader most often."""

WAYS: tuple[tuple[str, Sightings, tuple[str, ...]], ...] = (
    ("world", "vicon", ()),
    ("body, odometry", "vicon", ("front_end='body'", "own_motion='odometry'")),
    ("body, mocap motion", "vicon", ("front_end='body'", "own_motion='mocap'")),
    ("body, auto", "vicon", ("front_end='body'", "own_motion='auto'")),
    ("camera", "camera", ()),
)
LIDAR, CALIBRATED_TO = "turtlebot3_lidar_optitrack", 6.6
FIGURES = ("v1", "/const", "/guess", "alpha1", "corr", "tracked", ">5sd", "nees v1", "nees alpha1", "nis")


def figures_of(log: Path, overrides: Sequence[str] = (), *, answered: bool = False) -> list[float]:
    """Figures of one log, replayed with keys of its scenario changed.

    ``answered``: with what ``abreast calibrate`` finds of how its motion answers its odometry.
    """
    opened = read_log(log)
    own = scenario_of(opened)
    if own is None:
        raise SystemExit(f"{log}: was not made by abreast")
    if answered:
        found = timing_of(opened, own).settings(own)
        own = with_overrides(own, [f"{key}={value}" for key, value in found.items() if ".input_" in key])
    scenario = with_overrides(own, [f"estimator.{each}" for each in overrides])
    columns = columns_of(run_data_of_replay(opened, replay(opened, scenario)))
    samples, v_eps = columns.samples, scenario.leader.v_eps
    moving = _moving(columns.estimates, columns, v_eps)
    tracked = _moving(samples, columns, v_eps) / max(1, moving)
    errors, true = errors_at(samples, columns.true), np.asarray(columns.true.v1)
    known = np.isfinite(true) if len(true) else np.zeros(0, dtype=np.bool_)
    if np.count_nonzero(known) < 10:
        return [np.nan] * 5 + [tracked] + [np.nan] * 4
    # The truth has no alpha1 where a leader stands.
    v1, alpha1 = errors["v1"][known], errors["alpha1"][known]
    sd_v1, sd_alpha1 = (samples.sd[known, QUANTITIES.index(name)] for name in ("v1", "alpha1"))
    known_alpha1 = np.isfinite(alpha1)
    rmse, everywhere = float(np.sqrt(np.mean(v1**2))), columns.truth.v1[np.isfinite(columns.truth.v1)]
    return [
        rmse,
        _over(rmse, true[known]),
        _over(rmse, everywhere),
        float(np.nanmedian(np.abs(alpha1))),
        float(np.corrcoef(np.asarray(samples.seen.v1)[known], true[known])[0, 1]),
        tracked,
        float(np.mean(np.abs(alpha1[known_alpha1]) > 5.0 * sd_alpha1[known_alpha1])),
        float(np.mean((v1 / sd_v1) ** 2)),
        float(np.nanmean((alpha1 / sd_alpha1) ** 2)),
        float(np.nanmean(samples.nis[known])),
    ]


def _over(rmse: float, speeds: NDArray[np.float64]) -> float:
    """An error over that of the best constant guess, where speeds differ."""
    guess = float(np.std(speeds))
    return rmse / guess if guess > 1e-6 else np.nan


def _moving(estimates: EstimateColumns, columns: Columns, v_eps: float) -> int:
    """At how many captures of the evaluated span estimates are of a leader that moves."""
    captures = np.unique(estimates.capture_ns[inside(estimates.capture_ns, columns.span)])
    return int(np.count_nonzero(columns.truth.at(captures).v1 > v_eps))


def main() -> None:
    """Print a line for every way of measuring."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="ways whose name has this in it")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of the estimator")
    parser.add_argument("--answered", action="store_true", help="odometry as calibrate says it is answered")
    parser.add_argument("--each", action="store_true", help="print every pair")
    given = parser.parse_args()
    real = Path(os.environ["ABREAST_REAL"])
    print(f"{'':22}" + "".join(f"{name:>12}" for name in FIGURES), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, sightings, overrides in WAYS:
            if given.only not in name:
                continue
            rows = []
            for leader, follower in PAIRS if sightings == "vicon" else CAMERA_PAIRS:
                log = Path(folder) / f"{sightings}{leader}{follower}.mcap"
                if not log.exists():
                    import_mrclam(real / "mrclam6", leader, follower, log, sightings)
                rows.append(figures_of(log, [*overrides, *given.set], answered=given.answered))
                if given.each:
                    _print(f"  {leader} seen by {follower}", rows[-1])
            _print(name, np.nanmedian(np.array(rows), axis=0).tolist())
        if given.only in "lidar":
            log = Path(folder) / "lidar.mcap"
            import_csv(real / f"{LIDAR}.csv", load_column_map(LIDAR), log)
            _print("lidar", figures_of(log, given.set))
            _print("lidar, calibrated", figures_of(log, [*_offsets(log), *given.set]))


def _offsets(log: Path) -> list[str]:
    """Keys of the estimator by which a sensor is put right, from the first seconds of its log."""
    opened = read_log(log)
    scenario = scenario_of(opened)
    assert scenario is not None
    found = calibrate(opened, scenario, None, CALIBRATED_TO)
    return [f"range_bias={found.range.value}", f"bearing_bias={found.bearing.value}"]


def _print(name: str, row: Sequence[float]) -> None:
    print(f"{name:22}" + "".join(f"{value:12.4f}" for value in row), flush=True)


if __name__ == "__main__":
    main()
