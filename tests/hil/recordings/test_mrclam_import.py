from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from formation.pose import Pose, advance
from formation.shape import shape_of
from hil.command_line import main
from hil.errors import UsageError
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.summary import summarise
from hil.log.metadata import mode_of, scenario_of
from hil.log.reader import Log, read_log
from hil.recordings.mrclam_import import import_mrclam
from hil.replay.odometry_alignment import judge_own_motion
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario, with_overrides
from hil.wire import topics
from hil.wire.message_types import Odometry, RangeBearing, RigidBodies, Truth
from hil.wire.messages import decode_as, to_ns

REAL = "ABREAST_REAL"
START_S = 1_248_444_200.0
LEADS, FOLLOWS = (0.08, 0.1), (0.07, -0.15)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds of two robots on circles, seen at different moments, the leader out of view once."""
    path, generator = tmp_path_factory.mktemp("mrclam"), np.random.default_rng(9)
    for robot, pose, (v, u), shift in (
        (3, Pose(0.0, 0.0, 0.5), LEADS, 0.004),
        (5, Pose(1.0, 0.5, 1.0), FOLLOWS, 0.0),
    ):
        track, odometry = ["# Time x y orientation"], ["# Time v u"]
        for k in range(600):
            t = k / 60.0 + shift
            at, shake = advance(pose, v, u, t), generator.normal(size=3) * [3e-4, 3e-4, 3e-3]
            if robot == 5 or not 480 <= k < 500:
                track.append(
                    f"{START_S + t:.3f} {at.x + shake[0]:.8f} {at.y + shake[1]:.8f} {at.theta + shake[2]:.8f}"
                )
            odometry.append(f"{START_S + t + 0.005:.3f} {v:.3f} {u:.3f}")
        (path / f"Robot{robot}_Groundtruth.dat").write_text("\n".join(track))
        (path / f"Robot{robot}_Odometry.dat").write_text("\n".join(odometry))
    return path


@pytest.fixture(scope="module")
def log(folder: Path) -> Log:
    out = folder / "pair.mcap"
    done = import_mrclam(folder, 3, 5, out)
    assert (done.rows, done.from_s) == (600, START_S)
    assert done.to_s == pytest.approx(START_S + 599 / 60, abs=1e-3)
    return read_log(out)


def test_the_log_says_what_it_is(log: Log) -> None:
    scenario = scenario_of(log)
    assert scenario is not None
    assert mode_of(log) == "import"
    assert (scenario.name, scenario.leader.name, scenario.follower.name) == ("mrclam", "robot3", "robot5")
    assert scenario.run.evaluate_from_s == START_S + 5.0
    assert log.metadata["source"]["leader"] == "robot3"


def test_messages_come_in_the_order_of_their_stamps(log: Log) -> None:
    stamps = [record.log_ns for record in log.records(list(log.topics))]
    assert stamps == sorted(stamps)
    assert {topic: sum(1 for _ in log.records([topic])) for topic in log.topics} == {
        topics.RIGID_BODIES: 600,
        "robot5/odom": 600,
        topics.TRUTH: 600,
        topics.LOG: 2,
    }
    first = decode_as(next(log.records(["robot5/odom"])).payload, Odometry)
    assert to_ns(first.header.stamp) == round((START_S + 0.005) * 1000) * 1_000_000
    assert (first.twist.twist.linear.x, first.twist.twist.angular.z) == FOLLOWS


def test_a_frame_holds_both_robots_at_one_moment(log: Log) -> None:
    frames = [decode_as(record.payload, RigidBodies) for record in log.records([topics.RIGID_BODIES])]
    for frame in frames[10:470]:
        leader, follower = frame.rigidbodies
        assert (leader.rigid_body_name, follower.rigid_body_name) == ("robot3", "robot5")
        t = to_ns(frame.header.stamp) * 1e-9 - START_S
        expected = advance(Pose(0.0, 0.0, 0.5), *LEADS, t)
        assert math.dist((leader.pose.position.x, leader.pose.position.y), (expected.x, expected.y)) < 2e-3
    unseen = [frame.frame_number for frame in frames if len(frame.rigidbodies) == 1]
    # Before its first pose, and while it was out of view.
    assert unseen == [0, *range(480, 501)]


def test_the_truth_knows_the_motion_and_says_where_it_does_not(log: Log) -> None:
    truths = [decode_as(record.payload, Truth) for record in log.records([topics.TRUTH])]
    known = [truth for truth in truths if math.isfinite(truth.v1) and math.isfinite(truth.v2)]
    assert np.mean([truth.v1 for truth in known]) == pytest.approx(LEADS[0], abs=1e-3)
    assert np.mean([truth.u1 for truth in known]) == pytest.approx(LEADS[1], abs=2e-3)
    assert np.mean([truth.v2 for truth in known]) == pytest.approx(FOLLOWS[0], abs=1e-3)
    assert np.mean([truth.u2 for truth in known]) == pytest.approx(FOLLOWS[1], abs=2e-3)
    assert all(math.isnan(truth.v1) for truth in truths[465:515])
    assert all(math.isfinite(truth.v2) for truth in truths[465:515])
    assert math.isnan(truths[0].v2)


def test_a_replay_of_the_log_finds_the_leader(log: Log) -> None:
    played = replay(log)
    summary = summarise(run_data_of_replay(log, played))
    assert summary["estimation"]["rmse"]["v1"] < 0.005
    assert summary["estimation"]["rmse"]["alpha1"] < 0.1
    assert summary["rejected"] == {"missing_leader": 22}


def test_the_command_imports_and_says_how_to_go_on(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["import", "mrclam", str(folder), "--leader", "5", "--follower", "3", "--out"]
    with pytest.raises(SystemExit) as done:
        main([*arguments, str(tmp_path / "pair.mcap")])
    assert done.value.code == 0
    assert "abreast replay" in capsys.readouterr().out
    with pytest.raises(SystemExit) as refused:
        main([*arguments, str(tmp_path / "pair.mcap")])
    assert refused.value.code == 2
    assert "exists already" in capsys.readouterr().err


@pytest.fixture(scope="module")
def sighted(folder: Path) -> Path:
    """The same, and what robot 5's camera saw four times a second: robot 3 and a landmark."""
    generator = np.random.default_rng(3)
    (folder / "Barcodes.dat").write_text("# Subject Barcode\n 3 41\n 5 23\n 6 72\n")
    rows = ["# Time Barcode range bearing"]
    for k in range(40):
        t = 0.25 * k
        leader, own = advance(Pose(0.0, 0.0, 0.5), *LEADS, t), advance(Pose(1.0, 0.5, 1.0), *FOLLOWS, t)
        true, shake = shape_of(leader, own), generator.normal(size=2) * [0.01, 0.005]
        rows.append(f"{START_S + t:.3f} 72 2.000 0.100")
        rows.append(f"{START_S + t:.3f} 41 {true.rho + shake[0]:.4f} {true.alpha2 + shake[1]:.4f}")
    (folder / "Robot5_Measurement.dat").write_text("\n".join(rows))
    return folder


def test_a_camera_sees_its_leader_by_the_bar_code_and_vicon_is_the_truth(sighted: Path) -> None:
    out = sighted / "camera.mcap"
    done = import_mrclam(sighted, 3, 5, out, "camera")
    assert done.rows == 40
    log = read_log(out)
    scenario = scenario_of(log)
    assert scenario is not None
    assert (scenario.name, scenario.estimator.front_end) == ("mrclam-camera", "body")
    assert topics.RIGID_BODIES not in log.topics
    seen = [decode_as(record.payload, RangeBearing) for record in log.records(["robot5/leader_sighting"])]
    assert len(seen) == 40
    true = shape_of(Pose(0.0, 0.0, 0.5), Pose(1.0, 0.5, 1.0))
    assert seen[0].rho == pytest.approx(true.rho, abs=0.05)
    assert seen[0].alpha2 == pytest.approx(true.alpha2, abs=0.02)
    at_ns = {to_ns(decode_as(record.payload, Truth).header.stamp) for record in log.records([topics.TRUTH])}
    assert {to_ns(each.header.stamp) for each in seen} <= at_ns


def test_a_leader_that_no_camera_saw_is_named(sighted: Path) -> None:
    (sighted / "Robot3_Measurement.dat").write_text(f"{START_S} 72 2.0 0.1\n")
    with pytest.raises(UsageError, match=r"robot 3 never saw robot 5 \(bar code 23\)"):
        import_mrclam(sighted, 5, 3, sighted / "unseen.mcap", "camera")
    assert not (sighted / "unseen.mcap").exists()


def test_nothing_is_left_behind_by_a_folder_that_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--leader 1"):
        import_mrclam(folder, 1, 5, tmp_path / "pair.mcap")
    assert not (tmp_path / "pair.mcap").exists()


def first_minute(out: Path, leader: int, follower: int) -> Path:
    """The first minute of two real robots."""
    out.mkdir()
    for path in (Path(os.environ[REAL]) / "mrclam6").glob(f"Robot[{leader}{follower}]_*.dat"):
        rows = path.read_text().splitlines()
        (out / path.name).write_text(
            "\n".join(r for r in rows if r[0] == "#" or float(r[:14]) < START_S + 60)
        )
    return out


@pytest.mark.slow
@pytest.mark.real
def test_a_real_leader_is_followed_and_commands_are_seen_to_run_ahead(tmp_path: Path) -> None:
    import_mrclam(first_minute(tmp_path / "mrclam6", 1, 2), 1, 2, tmp_path / "real.mcap")
    log = read_log(tmp_path / "real.mcap")
    scenario = with_overrides(scenario_of(log) or load_scenario("mrclam"), ["estimator.own_motion=mocap"])
    estimation = summarise(run_data_of_replay(log, replay(log, scenario)))["estimation"]
    assert estimation["samples"] > 3000
    assert estimation["rmse"]["v1"] <= 0.014
    assert estimation["coverage_3sigma"]["v1"] >= 0.95
    own = judge_own_motion(log, scenario)
    assert 0.15 < own["delay_s"] + own["time_constant_s"] < 0.35
    assert 0.8 < own["scale_v"] < 1.0
    assert 0.75 < own["scale_u"] < 1.0
