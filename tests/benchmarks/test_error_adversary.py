from __future__ import annotations

import numpy as np
import pytest

from benchmarks.error_adversary import TURTLEBOT3, WHOLE, Robots, drive_out
from formation.error_set import error_set
from formation.invariant_set import InvariantSet
from formation.joint_set import Aside, joint_set

MODEL = TURTLEBOT3._replace(W=0.015)


@pytest.fixture(scope="module")
def inside() -> InvariantSet:
    found = error_set(MODEL)
    assert found is not None
    return found.inside


@pytest.mark.slow
def test_nothing_gets_out_of_the_proved_set_and_something_comes_near_its_edge(inside: InvariantSet) -> None:
    came = drive_out(MODEL, inside, np.random.default_rng(1), pairs=300, duration=20.0)
    assert (came.left, came.lost) == (0, 0)
    assert came.reached > 0.95


@pytest.mark.slow
def test_nothing_gets_out_of_the_joint_set_from_anywhere_in_alpha2s_ball() -> None:
    found = joint_set(MODEL, Aside(2.0))
    assert found is not None
    came = drive_out(MODEL, found, np.random.default_rng(2), 300, 20.0, WHOLE)
    assert (came.left, came.lost) == (0, 0)
    assert came.reached > 0.5
    worse = drive_out(MODEL._replace(W=0.03), found, np.random.default_rng(2), 300, 10.0, WHOLE)
    assert worse.left > 5, "it does not hold for twice the error"


def test_errors_beyond_those_assumed_drive_pairs_out(inside: InvariantSet) -> None:
    worse = MODEL._replace(W=0.02)
    assert drive_out(worse, inside, np.random.default_rng(1), pairs=200, duration=8.0).left > 5


def test_what_the_model_leaves_out_is_seen(inside: InvariantSet) -> None:
    """Motors that lag a lot take pairs out of a set that knows of none."""
    slow = Robots(lag=0.3)
    assert drive_out(MODEL, inside, np.random.default_rng(1), 100, 8.0, slow).left > 0
