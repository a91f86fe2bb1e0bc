from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from estimation.calibration.sensor_bias import SensorBias
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import shape_of
from hil.errors import UsageError
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.summary import summarise
from hil.log.metadata import scenario_of
from hil.log.reader import Log, read_log
from hil.recordings.column_map import load_column_map
from hil.recordings.csv_import import import_csv
from hil.replay.calibration import calibrate
from hil.replay.rerun import replay
from hil.scenario.files import with_overrides
from hil.scenario.schema import Scenario

REAL = "ABREAST_REAL"
RANGE_OFFSET, BEARING_OFFSET = 0.04, -0.2
PLACE = (-0.09, 0.06)
POSES = """leader_x = "x1"
leader_y = "y1"
leader_theta = "th1"
follower_x = "x2"
follower_y = "y2"
follower_theta = "th2"
"""
CHART = f"""[columns]
t = "t"
rho = "rho"
alpha2 = "alpha2"
v2 = "v2"
u2 = "u2"
[truth]
v1 = {{ constant = 0.1 }}
{POSES}[scenario.run]
evaluate_from_s = 103.0
[scenario.estimator]
front_end = "body"
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pair that drives for ten seconds; the follower sees the leader with offsets, once something else."""
    return recorded(tmp_path_factory.mktemp("lab") / "lab.csv", (0.0, 0.0))


def recorded(path: Path, place: tuple[float, float]) -> Path:
    """Recording of a sensor at a place on the follower, ahead and to the left."""
    generator = np.random.default_rng(4)
    leader, follower = Pose(0.6, 0.2, 0.1), Pose(0.0, 0.0, 0.3)
    lines = ["t,rho,alpha2,v2,u2,x1,y1,th1,x2,y2,th2"]
    for k in range(200):
        own = Motion(0.12, 0.5 * math.sin(0.05 * k))
        at = follower.x + 1j * follower.y + complex(*place) * np.exp(1j * follower.theta)
        shape = shape_of(leader, Pose(at.real, at.imag, follower.theta))
        stray = 0.8 if k == 60 else 0.0
        rho = shape.rho + RANGE_OFFSET + stray + 0.003 * generator.standard_normal()
        alpha2 = wrap(shape.alpha2 + BEARING_OFFSET + stray + 0.01 * generator.standard_normal())
        cells = (100 + 0.05 * k, rho, alpha2, own.v, own.u, *_flat(leader), *_flat(follower))
        lines.append(",".join(f"{cell:.6f}" for cell in cells))
        leader, follower = advance(leader, 0.1, 0.05, 0.05), advance(follower, own.v, own.u, 0.05)
    path.write_text("\n".join(lines) + "\n")
    return path


def _flat(pose: Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta


def imported(recording: Path, chart: str, folder: Path) -> tuple[Log, Scenario]:
    (folder / "lab.toml").write_text(chart)
    import_csv(recording, load_column_map(str(folder / "lab.toml")), folder / "lab.mcap")
    log = read_log(folder / "lab.mcap")
    scenario = scenario_of(log)
    assert scenario is not None
    return log, scenario


def alpha1_rmse(log: Log, scenario: Scenario, found: SensorBias | None) -> float:
    if found is not None:
        offsets = {"range_bias": found.range.value, "bearing_bias": found.bearing.value}
        scenario = with_overrides(scenario, [f"estimator.{name}={value}" for name, value in offsets.items()])
    judged = summarise(run_data_of_replay(log, replay(log, scenario)))["estimation"]
    rmse: float = judged["rmse"]["alpha1"]
    return rmse


def test_offsets_found_in_one_span_make_the_rest_of_the_log_better(recording: Path, tmp_path: Path) -> None:
    log, scenario = imported(recording, CHART, tmp_path)
    found = calibrate(log, scenario, to_s=105.0)
    assert found.range.value == pytest.approx(RANGE_OFFSET, abs=2e-3)
    assert found.bearing.value == pytest.approx(BEARING_OFFSET, abs=4e-3)
    assert (found.samples, found.outliers) == (101, 1)
    assert calibrate(log, scenario, from_s=104.0).samples == 120
    assert alpha1_rmse(log, scenario, found) < 0.5 * alpha1_rmse(log, scenario, None)


def test_offsets_are_those_of_a_sensor_at_the_place_that_is_told(tmp_path: Path) -> None:
    log, scenario = imported(recorded(tmp_path / "lab.csv", PLACE), CHART, tmp_path)
    placed = with_overrides(
        scenario, [f"estimator.sensor_{axis}={at}" for axis, at in zip("xy", PLACE, strict=True)]
    )
    found, blind = calibrate(log, placed, to_s=105.0), calibrate(log, scenario, to_s=105.0)
    assert found.range.value == pytest.approx(RANGE_OFFSET, abs=2e-3)
    assert found.bearing.value == pytest.approx(BEARING_OFFSET, abs=4e-3)
    # Without the place the offsets make up for it in the calibrated span only.
    assert alpha1_rmse(log, placed, found) < 0.8 * alpha1_rmse(log, scenario, blind)


def test_a_log_that_cannot_tell_is_refused(recording: Path, tmp_path: Path) -> None:
    log, scenario = imported(recording, CHART.replace(POSES, ""), tmp_path)
    with pytest.raises(UsageError, match="has no poses of 'leader' and 'follower' beside its sightings"):
        calibrate(log, scenario)


def test_a_span_that_is_too_short_is_refused(recording: Path, tmp_path: Path) -> None:
    log, scenario = imported(recording, CHART, tmp_path)
    with pytest.raises(UsageError, match="11 sightings have a true pose beside them"):
        calibrate(log, scenario, to_s=100.5)


@pytest.mark.real
def test_the_first_seconds_of_a_real_log_calibrate_its_scanner(tmp_path: Path) -> None:
    source = Path(os.environ[REAL]) / "turtlebot3_lidar_optitrack.csv"
    import_csv(source, load_column_map("turtlebot3_lidar_optitrack"), tmp_path / "real.mcap")
    log = read_log(tmp_path / "real.mcap")
    scenario = scenario_of(log)
    assert scenario is not None
    found = calibrate(log, scenario, to_s=6.6)
    # The scanner sits 32 mm behind the axis, and what it sees of the leader is 60 mm nearer than its centre.
    assert found.range.value == pytest.approx(-0.06, abs=4e-3)
    assert found.bearing.value == pytest.approx(-0.037, abs=1e-2)
    assert alpha1_rmse(log, scenario, None) <= 0.12
    assert alpha1_rmse(log, scenario, found) <= 0.06
