from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil.judge.assumptions import judge_assumptions
from hil.judge.columns import columns_of
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.run_data import RunData
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.recordings.column_map import load_column_map
from hil.recordings.csv_import import import_csv
from hil.replay.calibration import calibrate
from hil.replay.rerun import replay
from hil.scenario.files import with_overrides
from hil.wire.assumed_errors import AssumedErrors

EXTENDED = ("v1_extended", "alpha1_extended", "h_extended")


def judged(run_data: RunData) -> dict[str, Any]:
    return judge_assumptions(run_data.scenario, columns_of(run_data))


def test_exact_inputs_keep_to_every_assumption(exact_run_data: RunData) -> None:
    found = judged(exact_run_data)
    assert set(found["input_errors_hold"].values()) == {1.0}
    assert set(found["input_errors_hold"]) == {"E_rho", "E_alpha2", "E_v2", "E_u2", "all"}
    assert {found["assumed"]["holds"][name] for name in EXTENDED} == {1.0}
    counts = found["assumed"]["where_inputs_hold"]["violations"]
    assert [counts[name] for name in EXTENDED] == [0, 0, 0]


def test_samples_whose_inputs_err_too_much_are_set_apart(exact_run_data: RunData) -> None:
    """A wild distance breaks the assumption, and so a wild v1 there is no one's fault; elsewhere it is."""
    assumed = AssumedErrors.of(exact_run_data.scenario).errors(0.2)
    estimates = list(exact_run_data.estimates)
    for number in (130, 150):
        estimates[number] = replace(estimates[number], v1=estimates[number].v1 + 1.0)
    estimates[130] = replace(estimates[130], rho=estimates[130].rho + 2.0 * assumed.E_rho)
    run_data = replace(exact_run_data, estimates=estimates)
    n = len(columns_of(run_data).samples.capture_ns)
    found = judged(run_data)
    assert found["input_errors_hold"]["E_rho"] == pytest.approx(1.0 - 1.0 / n)
    assert found["input_errors_hold"]["E_v2"] == 1.0
    assert found["assumed"]["holds"]["v1_extended"] == pytest.approx(1.0 - 2.0 / n)
    there = found["assumed"]["where_inputs_hold"]
    assert there["samples"] == n - 1
    assert there["violations"]["v1_extended"] == 1


def test_only_inputs_whose_truth_is_known_are_asked(exact_run_data: RunData) -> None:
    truth = [replace(each, v2=float("nan"), u2=float("nan")) for each in exact_run_data.truth]
    found = judged(replace(exact_run_data, truth=truth))
    assert set(found["input_errors_hold"]) == {"E_rho", "E_alpha2", "all"}
    assert judged(replace(exact_run_data, truth=[])) == {}


@pytest.mark.real
def test_on_a_real_recording_extended_bounds_hold_wherever_their_assumptions_do(tmp_path: Path) -> None:
    """Raw, its range is off by more than was assumed, and that is said; calibrated, all is as assumed."""
    recording = Path(os.environ["ABREAST_REAL"]) / "turtlebot3_lidar_optitrack.csv"
    path = tmp_path / "real.mcap"
    import_csv(recording, load_column_map("turtlebot3_lidar_optitrack"), path)
    log = read_log(path)
    scenario = scenario_of(log)
    assert scenario is not None
    raw = judged(run_data_of_replay(log, replay(log), from_s=2.0))
    assert raw["input_errors_hold"]["E_rho"] < 0.1
    assert raw["assumed"]["holds"]["paper_h"] < 0.95
    offsets = calibrate(log, scenario, to_s=6.6)
    corrected = with_overrides(
        scenario,
        [
            f"estimator.range_bias={offsets.range.value}",
            f"estimator.bearing_bias={offsets.bearing.value}",
        ],
    )
    found = judged(run_data_of_replay(log, replay(log, corrected), from_s=2.0))
    assert found["input_errors_hold"]["all"] > 0.9
    there = found["assumed"]["where_inputs_hold"]
    assert there["samples"] > 100
    assert [there["violations"][name] for name in EXTENDED] == [0, 0, 0]
    assert found["assumed"]["holds"]["paper_h"] < 1.0
