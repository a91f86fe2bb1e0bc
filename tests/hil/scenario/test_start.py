from __future__ import annotations

from itertools import pairwise

import pytest

from formation.pose import Pose
from formation.shape import shape_of
from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.scenario.start import chain_poses, start_poses, start_shape


def test_a_pair_stands_where_the_scenario_says() -> None:
    scenario = load_scenario("turtlebot3")
    assert start_poses(scenario) == (Pose(0.287, 0.005, 1.553), Pose(0.767, 0.685, -1.574))
    assert start_shape(scenario).rho == pytest.approx(0.832346, abs=5e-7)
    assert chain_poses(scenario, 2) == start_poses(scenario)


def test_every_agent_of_a_chain_stands_to_its_predecessor_as_the_second_to_the_first() -> None:
    scenario = load_scenario("turtlebot3")
    poses, wanted = chain_poses(scenario, 4), start_shape(scenario)
    for leader, follower in pairwise(poses):
        shape = shape_of(leader, follower)
        assert (shape.rho, shape.alpha1, shape.alpha2) == pytest.approx(
            (wanted.rho, wanted.alpha1, wanted.alpha2), abs=1e-12
        )


def test_robots_in_one_place_are_named() -> None:
    scenario = load_scenario("turtlebot3", ["follower.pose=[0.287, 0.005, 0.0]"])
    with pytest.raises(UsageError, match=r"both at \(0\.287, 0\.005\)"):
        start_poses(scenario)
