"""Laws and estimators of one's own through the door: functions at hand, and files that change meanwhile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abreast
from abreast import Scenario

LAW = """
def own(shape, leader, gains):
    return {share} * leader.v1, -gains.mu2 * shape.cos2
"""


def prop_2(shape: Any, leader: abreast.Leader, gains: Any) -> tuple[float, float]:
    f = gains.mu_rho * ((shape.rho - gains.rho_0) / shape.rho) * ((shape.rho + gains.rho_0) / shape.rho)
    v2 = -leader.v1 * shape.sin1 + shape.rho * (leader.v1 * f - gains.mu1 * shape.cos1)
    driven = max(-gains.v_max, min(gains.v_max, v2))
    line_rate = (leader.v1 * shape.sin1 + driven * shape.sin2) / shape.rho
    return v2, line_rate - gains.mu2 * shape.cos2


def failing(shape: Any, leader: abreast.Leader, gains: Any) -> tuple[float, float]:
    raise ValueError("no idea")


class Plain(abreast.Estimator):
    def __init__(self, model: Any) -> None:
        self.model = model

    def start(self, measurement: Any) -> Any:
        return self.model.start(measurement)

    def predict(self, belief: Any, dt: float, follower: Any) -> Any:
        F = self.model.transition(belief.mean, dt, follower)
        Q = self.model.process_noise(belief.mean, dt, follower)
        mean = self.model.propagate(belief.mean, dt, follower)
        return belief._replace(mean=mean, covariance=F @ belief.covariance @ F.T + Q)

    def update(self, belief: Any, measurement: Any) -> Any:
        P = belief.covariance
        K = P[:, :2] @ np.linalg.inv(P[:2, :2] + measurement.covariance)
        mean = belief.mean + K @ (measurement.position - belief.mean[:2])
        return belief._replace(mean=mean, covariance=P - K @ P[:2])


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return abreast.load_scenario("turtlebot3", {"run.duration_s": 3.0, "run.evaluate_from_s": 1.0})


def test_prop_2_at_hand_drives_as_the_shipped_one(scenario: Scenario, tmp_path: Path) -> None:
    shipped = abreast.run_lockstep(scenario)
    own = abreast.run_lockstep(scenario, law=prop_2, log=tmp_path / "own.mcap")
    assert np.array_equal(own.commands.v2, shipped.commands.v2)
    assert np.array_equal(own.commands.u2, shipped.commands.u2)
    assert own.summary["law"]["name"].endswith(":prop_2")
    again = abreast.replay(tmp_path / "own.mcap", verify=True)
    assert again.summary["parity"]["commands"]["mismatched"] == 0
    assert np.array_equal(abreast.simulate(scenario, law=prop_2).poses, abreast.simulate(scenario).poses)


def test_an_estimator_at_hand_is_about_the_ekf() -> None:
    """By process noise that is given, which an estimator of one's own cannot be given anew."""
    changed = {"run.duration_s": 3.0, "run.evaluate_from_s": 1.0, "estimator.process_noise": "given"}
    scenario = abreast.load_scenario("turtlebot3", changed)
    own, ekf = abreast.run_lockstep(scenario, estimator=Plain), abreast.run_lockstep(scenario)
    good = (own.estimates.status == "tracking") & (ekf.estimates.status == "tracking")
    assert np.count_nonzero(good) > 200
    assert np.all(np.abs(own.estimates.v1 - ekf.estimates.v1)[good] < 0.01)


def test_both_are_swept(scenario: Scenario) -> None:
    grid = {"sigma_position": [3e-4], "sigma_heading": [3.5e-3]}
    found = abreast.sweep({"grid": grid}, runs=1, duration_s=2.0, law=prop_2, estimators=["ekf", Plain])
    assert [cell["estimator"].rpartition(":")[2] for cell in found.cells] == ["ekf", "Plain"]


def test_a_law_that_fails_is_warned_of_and_the_run_is_there(scenario: Scenario) -> None:
    with pytest.warns(RuntimeWarning, match=r"law .*failing failed in \d+ commands.*no idea"):
        run = abreast.run_lockstep(scenario, law=failing)
    assert np.all(run.commands.v2 == 0.0)


def test_a_function_defined_anew_is_the_new_one(scenario: Scenario) -> None:
    """As in a notebook, whose cells are run again."""
    ends = []
    for share in (0.5, 1.0):
        defined: dict[str, Any] = {}
        exec(LAW.format(share=share), defined)
        ends.append(abreast.simulate(scenario, law=defined["own"]).v[-1, 1])
    assert ends[1] == 2.0 * ends[0]


def test_a_file_that_was_edited_is_the_new_one(scenario: Scenario, tmp_path: Path) -> None:
    ends = []
    for share in (0.5, 1.0):
        (tmp_path / "my_law.py").write_text(LAW.format(share=share), encoding="utf-8")
        ends.append(abreast.simulate(scenario, law=f"{tmp_path / 'my_law.py'}:own").v[-1, 1])
    assert ends[1] == 2.0 * ends[0]


def test_workers_are_not_given_what_only_this_program_has() -> None:
    defined: dict[str, Any] = {}
    exec(LAW.format(share=1.0), defined)
    with pytest.raises(abreast.UsageError, match="own is at hand in this program only; put it into a file"):
        abreast.sweep(law=defined["own"], workers=2)


def test_no_workers_at_all_are_refused() -> None:
    with pytest.raises(abreast.UsageError, match="workers is 0, expected a number of processes"):
        abreast.sweep(workers=0)
