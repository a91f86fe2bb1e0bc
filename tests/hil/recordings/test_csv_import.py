from __future__ import annotations

import csv
import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from formation.angles import wrap
from formation.pose import Pose
from formation.shape import shape_of
from hil.errors import UsageError
from hil.lockstep.run import run_lockstep
from hil.log.metadata import mode_of, scenario_of
from hil.log.reader import Log, read_log
from hil.recordings.column_map import load_column_map
from hil.recordings.csv_import import import_csv
from hil.replay.rerun import Replay, replay
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import LeaderEstimate, Truth
from hil.wire.messages import decode_as, to_ns

REAL = "ABREAST_REAL"
BODY_MAP = """
[columns]
t = "t"
rho = "rho"
alpha2 = { column = "alpha2_deg", scale = 0.017453292519943295 }
v2 = "v2"
u2 = "u2"
[truth]
v1 = "v1"
leader_x = "x1"
leader_y = "y1"
leader_theta = "th1"
follower_x = "x2"
follower_y = "y2"
follower_theta = "th2"
[scenario.estimator]
front_end = "body"
sigma_range = 0.001
sigma_bearing = 0.003
sigma_v2 = 0.001
sigma_u2 = 0.005
slip_v2 = 0.0
slip_u2 = 0.0
"""
POSE_MAP = """
[columns]
t = "t"
leader_x = "x1"
leader_y = "y1"
follower_x = "x2"
follower_y = "y2"
follower_theta = "th2"
v2 = "v2"
u2 = "u2"
[scenario]
base = "turtlebot3"
"""

POSES_ALONE = POSE_MAP.replace('v2 = "v2"\nu2 = "u2"\n', "")


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> list[Truth]:
    """True states of the first 6 s of the closed loop, 120 a second."""
    path = tmp_path_factory.mktemp("driven") / "run.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=6"]), path)
    states = [decode_as(record.payload, Truth) for record in read_log(path).records([topics.TRUTH])]
    return states[: 6 * 120]


def table(truth: list[Truth], path: Path) -> Path:
    """The true states as a lab would have recorded them: with noise, in its own units, time from 0."""
    noise = np.random.default_rng(5).normal(size=(len(truth), 7))
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t", "rho", "alpha2_deg", "v1", "x1", "y1", "th1", "x2", "y2", "th2", "v2", "u2"])
        for each, draw in zip(truth, noise.tolist(), strict=True):
            leader = Pose(each.leader_x, each.leader_y, each.leader_theta)
            follower = Pose(each.follower_x, each.follower_y, each.follower_theta)
            shape = shape_of(leader, follower)
            bearing = math.degrees(shape.alpha2 + 0.003 * draw[1])
            poses = [leader.x, leader.y, leader.theta, follower.x, follower.y, follower.theta]
            poses = [value + 0.0003 * draw[2] for value in poses]
            t = (to_ns(each.header.stamp) - to_ns(truth[0].header.stamp)) * 1e-9
            motion = [each.v2 + 0.001 * draw[5], each.u2 + 0.005 * draw[6]]
            writer.writerow([t, shape.rho + 0.001 * draw[0], bearing, each.v1, *poses, *motion])
    return path


def imported(folder: Path, text: str, recording: Path) -> Log:
    (folder / "lab.toml").write_text(text)
    import_csv(recording, load_column_map(str(folder / "lab.toml")), folder / "lab.mcap")
    return read_log(folder / "lab.mcap")


def errors(played: Replay, truth: list[Truth], from_s: float) -> tuple[float, float]:
    """RMSE of v1 and alpha1 of the estimates from a time on."""
    start_ns = to_ns(truth[0].header.stamp)
    by_time = {to_ns(each.header.stamp) - start_ns: each for each in truth}
    v1, alpha1 = [], []
    for estimate in played.estimates:
        t_ns = to_ns(estimate.header.stamp)
        near = next((by_time[t] for t in range(t_ns - 200, t_ns + 200) if t in by_time), None)
        if t_ns < from_s * 1e9 or near is None:
            continue
        shape = shape_of(
            Pose(near.leader_x, near.leader_y, near.leader_theta),
            Pose(near.follower_x, near.follower_y, near.follower_theta),
        )
        v1.append(estimate.v1 - near.v1)
        alpha1.append(float(wrap(estimate.alpha1 - shape.alpha1)))
    assert len(v1) > 300
    return float(np.sqrt(np.mean(np.square(v1)))), float(np.sqrt(np.mean(np.square(alpha1))))


@pytest.mark.parametrize(
    ("text", "most"), [(BODY_MAP, (0.003, 0.05)), (POSE_MAP, (0.001, 0.04)), (POSES_ALONE, (0.001, 0.04))]
)
def test_a_recording_with_noise_gives_estimates_close_to_the_truth(
    text: str, most: tuple[float, float], driven: list[Truth], tmp_path: Path
) -> None:
    log = imported(tmp_path, text, table(driven, tmp_path / "lab.csv"))
    played = replay(log)
    assert not set(played.estimator.refused) - {"gated"}
    assert len(played.estimates) == len(driven)
    found = errors(played, driven, from_s=2.0)
    assert found[0] < most[0]
    assert found[1] < most[1]


def test_the_log_says_what_it_is_and_keeps_the_sources_own_time(driven: list[Truth], tmp_path: Path) -> None:
    log = imported(tmp_path, BODY_MAP, table(driven, tmp_path / "lab.csv"))
    scenario = scenario_of(log)
    assert mode_of(log) == "import"
    assert scenario is not None
    assert (scenario.name, scenario.estimator.front_end) == ("lab", "body")
    assert log.metadata["source"] == {"file": "lab.csv", "map": "lab.toml"}
    assert log.start_ns == 0
    record = next(log.records([topics.TRUTH]))
    truth = decode_as(record.payload, Truth)
    assert truth.v1 == driven[0].v1
    assert math.isnan(truth.u1)
    assert math.isnan(truth.v2)


@pytest.mark.parametrize(
    ("inputs", "expected"), [("measured", [0.1, 0.2, 0.3]), ("commanded", [0.0, 0.1, 0.2])]
)
def test_a_measurement_rests_on_commands_before_it_and_on_odometry_up_to_it(
    inputs: str, expected: list[float], tmp_path: Path
) -> None:
    path = tmp_path / "lab.csv"
    path.write_text("t,rho,alpha2_deg,v2,u2\n1,0.5,90,0.1,0.1\n1.1,0.5,90,0.1,0.2\n1.2,0.5,90,0.1,0.3\n")
    text = (
        f'inputs = "{inputs}"\n' + BODY_MAP.split("[truth]")[0] + '[scenario.estimator]\nfront_end = "body"\n'
    )
    played = replay(imported(tmp_path, text, path))
    assert [estimate.u2 for estimate in played.estimates] == expected


def test_nothing_is_left_behind_by_a_recording_that_is_refused(driven: list[Truth], tmp_path: Path) -> None:
    path = table(driven, tmp_path / "lab.csv")
    path.write_text(path.read_text() + "1,2,3\n" * 200)
    with pytest.raises(UsageError, match=r"line 722 has 3 cells.*200 of 920 lines"):
        imported(tmp_path, BODY_MAP, path)
    assert not (tmp_path / "lab.mcap").exists()


def test_a_log_that_exists_is_kept(driven: list[Truth], tmp_path: Path) -> None:
    (tmp_path / "lab.mcap").write_bytes(b"precious")
    with pytest.raises(UsageError, match="exists already"):
        imported(tmp_path, BODY_MAP, table(driven, tmp_path / "lab.csv"))
    assert (tmp_path / "lab.mcap").read_bytes() == b"precious"


@pytest.mark.real
def test_a_pair_of_real_robots_is_followed_through_a_misassociation(tmp_path: Path) -> None:
    recording = Path(os.environ[REAL]) / "turtlebot3_lidar_optitrack.csv"
    import_csv(recording, load_column_map("turtlebot3_lidar_optitrack"), tmp_path / "real.mcap")
    estimates = replay(read_log(tmp_path / "real.mcap")).estimates
    with recording.open() as stream:
        alpha1 = {
            round(float(row["time"]) * 1e9): float(row["alpha1_mocap"]) for row in csv.DictReader(stream)
        }
    late = [each for each in estimates if at_ns(each) >= 2_000_000_000]
    assert len(late) == sum(t >= 2_000_000_000 for t in alpha1)
    v1_errors = [each.v1 - 0.0792 for each in late]
    alpha1_errors = [float(wrap(each.alpha1 - alpha1[at_ns(each)])) for each in late]
    assert np.sqrt(np.mean(np.square(v1_errors))) <= 0.005
    assert np.sqrt(np.mean(np.square(alpha1_errors))) <= 0.15
    # The misassociation, and what came right after it.
    number = [at_ns(each) for each in late].index(6_669_100_000)
    assert late[number].reason == "newest measurement outside the gate"
    assert [each.status for each in late[number + 1 : number + 20]] == [1] * 19
    assert all(abs(after.rho - before.rho) < 0.05 for before, after in pairwise(late))


def at_ns(estimate: LeaderEstimate) -> int:
    return to_ns(estimate.header.stamp)
