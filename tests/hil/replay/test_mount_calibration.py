"""Mounts out of logs, and what they are good for: the next drive."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from estimation.calibration.mounts import NOTHING_FOUND
from formation.mount import Mount
from hil.judge.replayed import ReplayChoice, replayed
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.replay.lab_calibration import calibration_of
from hil.replay.mount_calibration import mounts_of_log, said
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode
from tests.hil.replay.calibrate_command import calibrated

LEADER, FOLLOWER = Mount(0.05, -0.02, -0.2), Mount(0.02, 0.03, 0.15)


def scenario_of(*overrides: str) -> Scenario:
    given = [f"mocap.leader_mount={list(LEADER)}", f"mocap.follower_mount={list(FOLLOWER)}"]
    return load_scenario(
        "turtlebot3", ["run.duration_s=14", "controller.mount_check=warn", *given, *overrides]
    )


@pytest.fixture(scope="module")
def run_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lab") / "run.mcap"
    run_lockstep(scenario_of(), path)
    return path


def rewritten(run_log: Path, path: Path, *, of_ours: bool = True, spin: float = 1.0) -> Path:
    """The log with the leader's orientation scaled to nothing, or without what says that it is ours."""
    log = read_log(run_log)
    with LogWriter(path, log.metadata if of_ours else {}) as out:
        for record in log.records([topics.RIGID_BODIES, "follower/odom", "leader/odom"]):
            payload = record.payload
            if record.topic == topics.RIGID_BODIES and spin == 0.0:
                frame = decode_as(payload, msg.RigidBodies)
                for body in frame.rigidbodies:
                    if body.rigid_body_name == "leader":
                        q = body.pose.orientation
                        q.x, q.y, q.z, q.w = 0.0, 0.0, 0.0, 1.0
                payload = encode(frame)
            out.write(record.topic, record.typename, payload, record.log_ns, record.publish_ns)
    return path


def test_both_mounts_are_told_in_full_with_the_lines_that_say_so(
    run_log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = calibrated(capsys, run_log, "--json")
    assert code == 0
    for robot, true in (("leader", LEADER), ("follower", FOLLOWER)):
        found = json.loads(out)["mounts"][robot]
        for name, value, sd in zip(("x", "y", "yaw"), true, found["sd"], strict=True):
            assert found[name] == pytest.approx(value, abs=2e-3)
            assert found[name] == pytest.approx(value, abs=5.0 * sd)
        assert f"body on the {robot}: yaw " in err
        assert f"[{robot}]\nmount = [0.0" in err


def test_a_second_drive_with_the_found_mounts_is_as_good_as_one_without_any(
    run_log: Path, tmp_path: Path
) -> None:
    found = calibration_of(read_log(run_log)).mounts
    again = scenario_of(*(f"{key}={value}" for key, value in found.overrides.items()), "run.seed=5")
    plain = load_scenario("turtlebot3", ["run.duration_s=14", "run.seed=5"])
    errors = []
    for scenario, name in ((again, "a.mcap"), (plain, "b.mcap")):
        run_lockstep(scenario, tmp_path / name)
        choice = ReplayChoice(from_s=4.0, to_s=14.0)
        errors.append(replayed(read_log(tmp_path / name), choice).summary["estimation"]["rmse"])
    mounted, without = errors
    # One run of ten seconds scatters by a tenth; over a dozen of them the ratio of v1 is 1.02.
    for name in ("v1", "alpha1"):
        assert mounted[name] < 1.3 * without[name]
    left = calibration_of(read_log(tmp_path / "a.mcap")).mounts
    assert left.follower.yaw == pytest.approx(FOLLOWER.yaw, abs=3e-3)


def test_a_follower_that_was_stopped_for_its_mount_has_told_its_yaw(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["mocap.follower_mount=[0.05, 0.02, -0.5]", "run.duration_s=6", "controller.mount_check=stop"]
    run_lockstep(load_scenario("turtlebot3", given), tmp_path / "stopped.mcap")
    code, out, err = calibrated(capsys, tmp_path / "stopped.mcap", "--json")
    assert code == 0
    found = json.loads(out)["mounts"]["follower"]
    assert found["yaw"] == pytest.approx(-0.5, abs=4.0 * found["sd"][2])
    assert found["sd"][2] < 0.035
    assert found["y"] is None
    assert 'controller.mount_check = "warn"' in err


def test_a_leader_without_orientation_has_no_mount_that_is_known(run_log: Path, tmp_path: Path) -> None:
    log = read_log(rewritten(run_log, tmp_path / "plain.mcap", spin=0.0))
    found = mounts_of_log(log, scenario_of())
    assert found.leader == NOTHING_FOUND
    assert found.follower.yaw == pytest.approx(FOLLOWER.yaw, abs=5e-3)
    assert set(found.settings) == {"follower.mount"}
    assert "no orientation" in said("leader", found)
    assert "measure by how much and set leader.mount" in said("leader", found)
    assert said("follower", found).startswith("body on the follower: yaw +")


def test_what_the_log_was_made_with_is_part_of_what_is_found(run_log: Path) -> None:
    log = read_log(run_log)
    found, with_known = (
        mounts_of_log(log, scenario_of(*more)).follower for more in ((), ("follower.mount=[0.01, 0, 0.1]",))
    )
    assert found == with_known


def test_a_log_of_another_lab_tells_its_mounts_by_a_map(
    run_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = rewritten(run_log, tmp_path / "other.mcap", of_ours=False)
    (tmp_path / "map.toml").write_text(
        '[topics]\nrigid_bodies = "rigid_bodies"\nodometry = "follower/odom"\n'
    )
    code, out, _ = calibrated(capsys, log, "--map", tmp_path / "map.toml", "--json")
    assert code == 0
    assert json.loads(out)["mounts"]["follower"]["yaw"] == pytest.approx(FOLLOWER.yaw, abs=5e-3)
