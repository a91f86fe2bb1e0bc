"""``abreast calibrate`` says how noisy a lab's measurements are."""

from __future__ import annotations

from pathlib import Path

import pytest

from estimation.calibration.sensor_bias import Offset, SensorBias
from hil.lockstep.run import Prepared, make_nodes, run_lockstep
from hil.log.metadata import log_metadata, scenario_of
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.lab_calibration import calibration_of
from hil.replay.noise_calibration import noise_of_log, said_noise
from hil.scenario.files import load_scenario
from hil.wire import topics

TRUE = {"mocap.sigma_position": 1e-3, "mocap.sigma_heading": 7e-3}
"""Three times and twice what the scenario tells its estimator."""


@pytest.fixture(scope="module")
def noisy_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("noise") / "run.mcap"
    scenario = load_scenario("turtlebot3", {**TRUE, "run.duration_s": 8.0, "mocap.rate_hz": 60.0})
    # No certificate is asked for, which takes longer than the run where nothing is compiled.
    run_lockstep(scenario, path, Prepared(make_nodes(scenario), log_metadata(scenario, "lockstep")))
    return read_log(path)


def noise(log: Log, sensor: SensorBias | None = None, **span: float) -> dict[str, float]:
    scenario = scenario_of(log)
    assert scenario is not None
    return noise_of_log(log, scenario, sensor, **span)


def test_a_run_tells_its_noise_and_how_odometry_scatters(noisy_log: Log) -> None:
    found = noise(noisy_log)
    assert found["sigma_position"] == pytest.approx(1e-3, rel=0.15)
    assert found["sigma_heading"] == pytest.approx(7e-3, rel=0.2)
    # Odometry is not late, and its own noise is 2 mm/s and 0.01 rad/s; the smoothed track adds some.
    assert 1e-3 < found["sigma_v2"] < 0.01
    assert 0.005 < found["sigma_u2"] < 0.06
    assert "sigma_range" not in found


def test_the_calibration_has_it_as_json_and_as_lines_of_a_scenario(noisy_log: Log) -> None:
    found = calibration_of(noisy_log)
    assert found.as_dict()["noise"] == found.noise
    assert found.noise["sigma_position"] == pytest.approx(1e-3, rel=0.15)
    lines = said_noise(found.noise).splitlines()
    assert lines[0] == "[estimator]"
    settings = dict(line.split(" = ") for line in lines[1:])
    told = load_scenario("turtlebot3", {f"estimator.{key}": float(text) for key, text in settings.items()})
    assert told.estimator.sigma_position == found.noise["sigma_position"]


def test_a_sensors_scatter_is_its_noise(noisy_log: Log) -> None:
    sensor = SensorBias(Offset(0.02, 1e-3, 0.0123456), Offset(0.0, 1e-3, 0.034), 100, 2)
    found = noise(noisy_log, sensor)
    assert (found["sigma_range"], found["sigma_bearing"]) == (0.0123, 0.034)


def test_what_a_log_does_not_tell_is_not_there(noisy_log: Log, tmp_path: Path) -> None:
    assert noise(noisy_log, to_s=0.1) == {}
    with LogWriter(tmp_path / "poor.mcap", noisy_log.metadata) as out:
        for record in noisy_log.records([name for name in noisy_log.topics if name != topics.RIGID_BODIES]):
            out.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    assert noise(read_log(tmp_path / "poor.mcap")) == {}
