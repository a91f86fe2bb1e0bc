"""`abreast gains`: proposals that hold in the closed loop."""

from __future__ import annotations

import json

import pytest

from benchmarks.gains import ROBOTS, kept_mm, proposed
from hil.command_line import main
from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.simulate.gain_proposal import task_of


@pytest.mark.parametrize("robot", list(ROBOTS))
def test_proposed_gains_keep_the_distance_about_as_well_as_hand_picked_ones(robot: str) -> None:
    assert kept_mm(robot, proposed(robot), seeds=1) < 1.25 * kept_mm(robot, ROBOTS[robot][1], seeds=1)


def test_the_command_prints_a_proposal(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["gains", "turtlebot3", "--json"])
    assert left.value.code == 0
    said = json.loads(capsys.readouterr().out)
    assert set(said["gains"]) == set(said["bounds"]) == {"mu1", "mu2", "mu_rho"}
    assert 0.12 < said["formation"]["rho_min"] < 0.2 < said["formation"]["rho_max"] < 0.28
    with pytest.raises(SystemExit) as left:
        main(["gains", "turtlebot3", "--set", "mocap.latency_s=3"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    assert text.startswith("no gains work: mu1 needs")
    assert "mu_rho: at least" in text


def test_the_estimates_are_taken_to_be_as_good_as_they_are() -> None:
    """Standard deviations of v1 and alpha1 as lockstep runs of this scenario show them."""
    task = task_of(load_scenario("turtlebot3"))
    assert task.sd_v1 == pytest.approx(0.0017, rel=0.25)
    assert task.sd_alpha1 == pytest.approx(0.0227, rel=0.25)


def test_only_followers_abreast_are_designed_for() -> None:
    with pytest.raises(UsageError, match=r"formation\.bearing is 1\.2"):
        task_of(load_scenario("turtlebot3", ["formation.bearing=1.2"]))
