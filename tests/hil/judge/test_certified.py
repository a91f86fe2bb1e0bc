from __future__ import annotations

from dataclasses import replace

import pytest

from hil.errors import UsageError
from hil.judge.certified import certified_violations
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.log.reader import Log
from hil.replay.rerun import replay
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario, with_overrides


def certified(log: Log, *overrides: str) -> RunData:
    """Run data of a log whose estimates are certified afterwards."""
    scenario = load_scenario("turtlebot3", ("run.seed=7", "run.duration_s=6.0", "run.evaluate_from_s=3.0"))
    given = with_overrides(scenario, ["mocap.loss=0.05", *overrides, CERTIFY])
    return run_data_of_replay(log, replay(log, given))


@pytest.fixture(scope="module")
def run_data(short_log: Log) -> RunData:
    return certified(short_log)


def test_no_error_of_a_run_exceeds_its_certified_radius(run_data: RunData) -> None:
    found = summarise(run_data)["certified"]
    assert found["certified"] > 300
    assert "failed" not in found
    for name, worst in (("v1", 0.06), ("alpha1", 1.0)):
        assert found[name]["violations"] == 0
        assert 0.0 < found[name]["tightness"] <= 1.0
        assert found[name]["median"] <= found[name]["largest"] < worst


def test_certifying_leaves_estimates_and_commands_as_they_were(short_log: Log, run_data: RunData) -> None:
    plain = replay(short_log)
    assert plain.mismatched == 0
    assert len(plain.estimates) == len(run_data.estimates) == len(run_data.certified)
    assert len(plain.commands) == len(run_data.commands)
    estimated = [(each.header.stamp, each.computed, each.v1, each.alpha1) for each in run_data.estimates]
    assert estimated == [
        (each.header.stamp, each.computed, each.v1, each.alpha1) for each in run_data.certified
    ]


def test_errors_beyond_a_radius_are_counted(run_data: RunData) -> None:
    wild = [replace(each, v1=each.v1 + 0.5) for each in run_data.certified]
    found = summarise(replace(run_data, certified=wild))
    assert found["certified"]["v1"]["tightness"] > 5.0
    assert certified_violations(found) == {"v1_certified": found["certified"]["certified"]}


def test_assumptions_that_fail_are_counted_by_name(short_log: Log) -> None:
    """A leader that is faster than it is said to be is found out, and no radius is made up."""
    found = summarise(certified(short_log, "leader.k_v=0.06"))["certified"]
    assert found["failed"]["noise"] > 100
    assert found["certified"] + sum(found["failed"].values()) > 300


def test_without_truth_radii_are_told_and_nothing_is_judged(run_data: RunData) -> None:
    found = summarise(replace(run_data, truth=[], motion_since_ns=None))["certified"]
    assert set(found["v1"]) == {"median", "largest"}


def test_logs_without_certified_estimates_have_no_such_part(short_log: Log) -> None:
    assert "certified" not in summarise(run_data_of_replay(short_log, replay(short_log)))


def test_too_coarse_a_body_front_end_is_refused(short_log: Log) -> None:
    with pytest.raises(UsageError, match="range, bearing and odometry leave the leader's velocity uncertain"):
        certified(short_log, "estimator.front_end=body")
