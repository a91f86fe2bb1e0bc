from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from click import Command

from estimation.tracking.tracker import Status
from hil.commands import run
from hil.commands.replay import command as replay_command
from hil.errors import UsageError
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.summary import summarise
from hil.lockstep.run import run_lockstep
from hil.log.metadata import scenario_of
from hil.log.reader import Log, read_log
from hil.nodes.estimator import EstimatorNode
from hil.replay.rerun import Replay, replay
from hil.scenario.files import load_scenario, with_overrides
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import to_ns


@pytest.fixture(scope="module")
def rough_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Six seconds with losses, and frames so late that some come out of order."""
    path = tmp_path_factory.mktemp("rough") / "run.mcap"
    given = ("run.duration_s=6", "run.evaluate_from_s=2", "mocap.loss=0.05", "mocap.jitter_s=0.02")
    run_lockstep(load_scenario("turtlebot3", given), path)
    return read_log(path)


@pytest.fixture(scope="module")
def filtered(rough_log: Log) -> Replay:
    return replay(rough_log)


@pytest.fixture(scope="module")
def smoothed(rough_log: Log) -> Replay:
    own = scenario_of(rough_log)
    assert own is not None
    return replay(rough_log, with_overrides(own, ["estimator.kind=smoother"]))


def rmse(log: Log, played: Replay) -> dict[str, float]:
    found: dict[str, float] = summarise(run_data_of_replay(log, played, 2.0, 5.5))["estimation"]["rmse"]
    return found


def captures(estimates: Sequence[LeaderEstimate]) -> list[int]:
    return [to_ns(each.header.stamp) for each in estimates]


def test_a_log_is_smoothed_at_each_of_its_captures_once_and_in_order(
    smoothed: Replay, filtered: Replay
) -> None:
    assert smoothed.commands == ()
    assert not smoothed.parity
    assert captures(smoothed.estimates) == sorted({*captures(smoothed.estimates)})
    assert {*captures(filtered.estimates)} <= {*captures(smoothed.estimates)}
    assert smoothed.scenario.estimator.kind == "smoother"
    assert smoothed.estimator.taken == filtered.estimator.taken
    assert all(np.linalg.eigvalsh(each.covariance.reshape(5, 5))[0] > 0.0 for each in smoothed.estimates)


def test_smoothed_estimates_are_closer_to_the_truth_than_the_filter_s(
    rough_log: Log, smoothed: Replay, filtered: Replay
) -> None:
    after, live = rmse(rough_log, smoothed), rmse(rough_log, filtered)
    assert after["v1"] < 0.7 * live["v1"]
    assert after["alpha1"] < 0.7 * live["alpha1"]


def test_the_leader_s_start_is_not_smeared_into_its_rest(smoothed: Replay, filtered: Replay) -> None:
    """While the leader stands the direction is not known; from when it drives on it is, without a delay."""
    statuses = [Status(each.status) for each in smoothed.estimates]
    first = statuses.index(Status.TRACKING)
    assert statuses[0] is Status.INITIALISING
    driving = statuses[first:-90]  # the robots stop before the end
    assert driving.count(Status.TRACKING) > 0.98 * len(driving)
    live = [Status(each.status) for each in filtered.estimates]
    assert first < live.index(Status.TRACKING)


def asked(command: Command, *arguments: object) -> None:
    command.main([str(argument) for argument in arguments], standalone_mode=False)


def test_it_cannot_run_live_and_says_where_it_can(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"needs a whole log.* abreast replay LOG --estimator smoother"):
        asked(run.command, "turtlebot3", "--estimator", "smoother", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
    with pytest.raises(UsageError, match="needs a whole log"):
        EstimatorNode(load_scenario("turtlebot3", ["estimator.kind=smoother"]))


def test_it_repeats_nothing_that_could_be_verified(rough_log: Log, tmp_path: Path) -> None:
    asking = (replay_command, rough_log.path, "--estimator", "smoother")
    with pytest.raises(UsageError, match="--verify compares with what was recorded: by ekf"):
        asked(*asking, "--verify")
    asked(*asking, "--csv", tmp_path / "track.csv")
    assert len((tmp_path / "track.csv").read_text().splitlines()) > 600
