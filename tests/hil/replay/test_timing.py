from __future__ import annotations

import json
from pathlib import Path

import pytest

from estimation.calibration.actuator_response import ActuatorResponse
from estimation.own_motion.input_alignment import Known
from hil.lockstep.run import run_lockstep
from hil.log.metadata import log_metadata
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.replay.rerun import replay
from hil.replay.timing import Timing, timing_of
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from tests.hil.replay.calibrate_command import calibrated

WRONG = load_scenario(
    "turtlebot3",
    [
        *("run.duration_s=8", "mocap.rate_hz=60", "mocap.clock_offset_s=0.03", "controller.lag_s=0.05"),
        *("estimator.stamp_offset_s=0.01", "estimator.coast_after_s=0.3"),
    ],
)
"""Stamps are 30 ms late, of which 10 are known of; the robots lag by 100 ms, and not by 50."""


@pytest.fixture(scope="module")
def run_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lab") / "run.mcap"
    run_lockstep(WRONG, path)
    return path


def without(run_log: Path, path: Path, *left_out: str) -> Path:
    """The log without some of its topics."""
    log = read_log(run_log)
    with LogWriter(path, log.metadata) as out:
        for record in log.records([topic for topic in log.topics if topic not in left_out]):
            out.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    return path


def test_a_short_run_with_wrong_timing_tells_the_right_one(
    run_log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = calibrated(capsys, run_log, "--json")
    assert code == 0
    found = json.loads(out)
    true = {"lag_s": 0.1, "transport_s": 0.0, "delay_s": 0.1, "stamp_offset_s": 0.03}
    for name, value in true.items():
        assert found[name] == pytest.approx(value, abs=3.0 * found[f"{name}_sd"])
        assert found[name] == pytest.approx(value, abs=6e-3)
        assert name in err
    assert found["delay_s_sd"] < 0.002
    settings = found["settings"]
    assert settings["controller.lag_s"] + settings["controller.transport_s"] == pytest.approx(0.1, abs=3e-3)
    options = " ".join(f"--set {key}={value:.4f}" for key, value in settings.items())
    assert f"run next with: {options}\n" in err
    assert "--set estimator.stamp_offset_s=0.0" in options


def test_a_run_with_an_offset_is_replayed_bit_for_bit(run_log: Path) -> None:
    played = replay(read_log(run_log))
    assert len(played.estimates) > 400
    assert played.mismatched == 0
    assert played.missing_inputs == 0


def test_what_was_driven_by_tells_the_same_as_the_records_of_it(run_log: Path, tmp_path: Path) -> None:
    bare = read_log(without(run_log, tmp_path / "bare.mcap", "follower/command", "rigid_bodies"))
    found, whole = timing_of(bare, WRONG), timing_of(read_log(run_log), WRONG)
    assert found.response == whole.response
    assert found.lateness is None
    assert found.unknown == ("offset of stamps unknown: the log has no mocap frames on 'rigid_bodies'",)


def test_a_span_that_is_too_short_for_stamps_may_tell_the_lag(run_log: Path) -> None:
    found = timing_of(read_log(run_log), WRONG, from_s=1.0, to_s=6.0)
    assert found.response is not None
    assert found.response.delay.value == pytest.approx(0.1, abs=5e-3)
    assert found.lateness is None
    assert "offset of stamps unknown: odometry and mocap of 'follower' tell too little" in found.unknown[0]


@pytest.mark.parametrize(
    ("left_out", "named"),
    [
        (("follower/odom", "rigid_bodies"), "no odometry on 'follower/odom'"),
        (
            ("follower/command", "follower/cmd_vel", "rigid_bodies"),
            "no commands on 'follower/command' or 'follower/cmd_vel'; offset of stamps unknown: the log has "
            "no mocap frames on 'rigid_bodies'",
        ),
    ],
)
def test_a_log_that_tells_nothing_is_refused_by_what_it_lacks(
    run_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], left_out: tuple[str, ...], named: str
) -> None:
    code, out, err = calibrated(capsys, without(run_log, tmp_path / "poor.mcap", *left_out))
    assert (code, out) == (2, "")
    assert "has no sightings to calibrate" in err
    assert named in err
    assert err.count("\n") == 1


def test_commands_that_stand_in_for_odometry_are_told_from_it(run_log: Path) -> None:
    scenario = load_scenario("turtlebot3", ["estimator.input_lag_s=0.3", "estimator.stamp_offset_s=0.01"])
    found = timing_of(read_log(run_log), scenario)
    assert (found.response, found.lateness) == (None, None)
    assert "commands stand in for odometry (estimator.input_lag_s is 0.3)" in found.unknown[0]
    assert "record wheel odometry" in found.unknown[0]


def test_odometry_that_repeats_commands_tells_the_lag_of_the_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = 'robot.odometry_faults=[{kind="commands", at_s=0.0}]'
    turning = 'leader.program={kind="sinusoid", v=0.08, u_mean=0.1, u_amplitude=0.5, omega=1.5}'
    given = [told, turning, "run.duration_s=30", "robot.lag_s=0.2", "controller.lag_s=0.2"]
    given += ["estimator.own_motion=mocap", "estimator.input_lag_s=0.3"]
    scenario = load_scenario("turtlebot3", given)
    run_lockstep(scenario, tmp_path / "run.mcap")
    code, out, err = calibrated(capsys, tmp_path / "run.mcap", "--json")
    assert code == 0
    found = json.loads(out)
    odometry, settings = found["odometry"], found["settings"]
    delay, lag, scale_v, scale_u = odometry["sd"]
    assert odometry["input_time_constant_s"] == pytest.approx(0.2, abs=4.0 * lag)
    assert odometry["input_delay_s"] == pytest.approx(0.0, abs=4.0 * delay + 0.01)
    assert odometry["input_scale_v"] == pytest.approx(1.0, abs=4.0 * scale_v)
    assert odometry["input_scale_u"] == pytest.approx(1.0, abs=4.0 * scale_u)
    assert lag < 0.04
    assert settings["estimator.input_time_constant_s"] == pytest.approx(0.2, abs=4.0 * lag)
    assert 0.0 < settings["estimator.input_lag_s"] < 0.05
    assert "input_time_constant_s" in err


def test_of_a_chain_a_follower_must_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with LogWriter(tmp_path / "chain.mcap", log_metadata(load_scenario("chain5-turtlebot3"), "live")):
        pass
    code, _, err = calibrated(capsys, tmp_path / "chain.mcap")
    assert code == 2
    assert "name a follower of it with --follower" in err
    code, _, err = calibrated(capsys, tmp_path / "chain.mcap", "--follower", "agent4")
    assert code == 2
    assert "no odometry on 'agent4/odom'" in err
    assert err.count("\n") == 1


def timing(transport: float, lateness: float | None, sd: float = 2e-3) -> Timing:
    """Timing of a robot with 100 ms of lag."""
    sure = Known(1.0, 0.01)
    response = ActuatorResponse(
        Known(transport, 1e-3), Known(0.1, 1e-3), Known(transport + 0.1, 1e-3), sure, sure, 900, 0
    )
    return Timing(response, None if lateness is None else Known(lateness, sd))


def with_estimator(*overrides: str) -> Scenario:
    return load_scenario("turtlebot3", [f"estimator.{each}" for each in overrides])


@pytest.mark.parametrize(
    ("found", "scenario", "expected"),
    [
        # Odometry that is stamped late makes the robot look slow and mocap look early by as much.
        (timing(0.04, -0.02), with_estimator(), (0.1, 0.04, {"stamp_offset_s": -0.02})),
        (timing(0.04, -0.02), with_estimator("stamp_offset_s=0.05"), (0.1, 0.04, {"stamp_offset_s": 0.03})),
        # What is known of odometry that is ahead counts once.
        (timing(0.04, 0.02), with_estimator("input_delay_s=0.02"), (0.1, 0.06, {"stamp_offset_s": 0.0})),
        # An answer before its command is noise, or odometry that is stamped early.
        (timing(-0.002, None), with_estimator(), (0.098, 0.0, {})),
        (
            timing(-0.04, 0.04),
            with_estimator(),
            (0.1, 0.0, {"stamp_offset_s": 0.0, "input_delay_s": 0.04}),
        ),
        # What may be off by more than it is worth is left as it is.
        (timing(0.0, 0.02, sd=0.015), with_estimator("stamp_offset_s=0.01"), (0.1, 0.0, {})),
        # Of an estimated clock the way is what is left to tell.
        (
            timing(0.0, 0.03),
            with_estimator("clock=estimated", "transport_latency_s=0.01"),
            (0.1, 0.0, {"transport_latency_s": 0.04}),
        ),
        (timing(0.0, -0.03), with_estimator("clock=estimated"), (0.1, 0.0, {"transport_latency_s": 0.0})),
    ],
)
def test_settings_are_what_the_log_was_made_with_and_what_it_shows_to_be_left(
    found: Timing, scenario: Scenario, expected: tuple[float, float, dict[str, float]]
) -> None:
    lag, transport, estimator = expected
    controller = {"controller.lag_s": lag, "controller.transport_s": transport}
    assert found.settings(scenario) == pytest.approx(
        controller | {f"estimator.{key}": value for key, value in estimator.items()}, abs=1e-9
    )
