from __future__ import annotations

import numpy as np
import pytest

from formation.angles import FloatArray
from hil.recordings.pair_log import Recorded, planar_placements
from hil.recordings.plausibility import doubts, fast_speed, hard_turn
from hil.scenario.files import load_scenario

SCENARIO = load_scenario("turtlebot3")
T = np.arange(0.0, 4.0, 0.01)
T_NS = np.round(T * 1e9).astype(np.int64)


def placed(x: FloatArray, y: float) -> FloatArray:
    return planar_placements(x, np.full_like(x, y), np.zeros_like(x))


def test_a_pair_as_it_should_be_raises_no_doubt() -> None:
    assert doubts(Recorded(T_NS, placed(0.08 * T, 0.3), placed(0.08 * T, 0.0)), SCENARIO) == ()
    assert doubts(Recorded(T_NS, sighting=np.ones((len(T), 2))), SCENARIO) == ()


@pytest.mark.parametrize(
    ("leader", "said"),
    [
        (placed(0.08 * T, 300.0), "the robots are 300 m apart"),
        (placed(0.08 * T, 0.001), "the robots are 1 mm apart"),
        (placed(0.3 * T, 0.3), "the leader drives at 0.3 m/s, leader.k_v is 0.1: add --set leader.k_v=0.36"),
        (np.full((len(T), 7), np.nan), "leader and follower are never seen at once"),
    ],
)
def test_what_does_not_look_right_is_said(leader: FloatArray, said: str) -> None:
    (found,) = doubts(Recorded(T_NS, leader, placed(0.08 * T, 0.0)), SCENARIO)
    assert said in found
    assert "\n" not in found


def test_a_tilted_body_is_said_and_a_few_tilted_rows_are_not() -> None:
    follower = placed(0.08 * T, 0.0)
    follower[:20, 3:] = [1.0, 0.0, 0.0, 0.0]
    assert doubts(Recorded(T_NS, placed(0.08 * T, 0.3), follower), SCENARIO) == ()
    follower[:, 3:] = np.array([1.0, 0.0, 0.0, 1.0]) * np.sqrt(0.5)
    (found,) = doubts(Recorded(T_NS, placed(0.08 * T, 0.3), follower), SCENARIO)
    assert found.startswith("the follower is tilted by 90 degrees")


def test_a_leader_that_turns_harder_than_it_is_told_to_is_said() -> None:
    leader = placed(0.0 * T, 0.3)
    leader[:, 5], leader[:, 6] = np.sin(0.8 * T), np.cos(0.8 * T)
    (found,) = doubts(Recorded(T_NS, leader, placed(0.08 * T, 0.0)), SCENARIO)
    assert found == "the leader turns at 1.6 rad/s, leader.k_u is 0.7: add --set leader.k_u=1.9"
    assert hard_turn(T_NS, placed(0.3 * T, 0.0)) == 0.0


def test_a_speed_takes_half_a_second() -> None:
    assert fast_speed(T_NS, np.column_stack([0.2 * T, 0.0 * T])) == pytest.approx(0.2)
    assert fast_speed(T_NS[:20], np.zeros((20, 2))) == 0.0
