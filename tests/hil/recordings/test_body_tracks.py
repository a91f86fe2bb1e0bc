from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.body_tracks import at_times, found_up, pair_of, turned_up

THREE = ["Box", "RB leader", "RB follower"]


@pytest.mark.parametrize(
    ("names", "leader", "follower", "pair"),
    [
        (["a", "b"], None, None, ("a", "b")),
        (["a", "b"], "b", None, ("b", "a")),
        (["a", "b"], None, "a", ("b", "a")),
        (["follower", "x"], None, None, ("x", "follower")),
        (["x", "Leader"], None, None, ("Leader", "x")),
        (THREE, None, None, ("RB leader", "RB follower")),
        (THREE, "Box", None, ("Box", "RB follower")),
        (["a", "b", "c"], "c", "a", ("c", "a")),
    ],
)
def test_a_pair_is_what_is_asked_for_or_obvious(
    names: list[str], leader: str | None, follower: str | None, pair: tuple[str, str]
) -> None:
    assert pair_of(names, leader, follower, "take") == pair


@pytest.mark.parametrize(
    ("names", "leader", "follower", "said"),
    [
        ([], None, None, "expected a leader and a follower; there are: none"),
        (["a"], None, None, "expected a leader and a follower; there are: 'a'"),
        (["a", "b", "c"], None, None, "has 3 bodies; name a pair"),
        (["a", "b", "c"], "a", None, "has 3 bodies; name a pair"),
        (["a", "b"], "z", None, "--leader 'z': no such body; there are: 'a', 'b'"),
        (["a", "b"], "a", "a", "'a' cannot be both"),
        (["leader 1", "leader 2", "follower"], None, None, "has 3 bodies"),
    ],
)
def test_a_pair_that_is_not_obvious_is_refused(
    names: list[str], leader: str | None, follower: str | None, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        pair_of(names, leader, follower, "take")


def driven(up: str, *, turning: float, moving: float) -> FloatArray:
    """A track on the ground with this axis up, turned back from one with z up."""
    t = np.linspace(0.0, 1.0, 50)
    zero = np.zeros_like(t)
    quaternions = Rotation.from_euler("z", (turning * t)[:, None]).as_quat()
    track = np.column_stack([moving * t, moving * t**2, zero, quaternions])
    for _ in range({"z": 0, "y": 3, "x": 2}[up]):
        track = turned_up(track, up)
    return track


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_axis_that_bodies_turn_about_is_up(up: str) -> None:
    track = driven(up, turning=2.0, moving=0.0)
    assert found_up([track], told="x" if up != "x" else "y") == up
    level = turned_up(track, up)
    heading = 2.0 * np.arctan2(level[:, 5], level[:, 6])
    assert heading[-1] == pytest.approx(2.0)
    assert_allclose(level[:, 3:5], 0.0, atol=1e-12)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_else_it_is_the_one_along_which_they_do_not_move(up: str) -> None:
    assert found_up([driven(up, turning=0.0, moving=1.0)], told="x" if up != "x" else "y") == up


def test_else_it_is_what_is_usual() -> None:
    assert found_up([driven("z", turning=0.0, moving=0.0)], told="y") == "y"
    assert found_up([np.full((5, 7), np.nan)], told="y") == "y"


@given(st.integers(0, 1000), st.sampled_from(["x", "y"]))
def test_turning_an_axis_up_is_a_rotation(seed: int, up: str) -> None:
    draw = np.random.default_rng(seed)
    body = Rotation.random(3, rng=draw) if hasattr(Rotation, "random") else Rotation.identity(3)
    track = np.column_stack([draw.normal(size=(3, 3)), body.as_quat()])
    turn = Rotation.from_euler("x", 90.0, degrees=True)
    if up == "x":
        turn = Rotation.from_matrix([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    found = turned_up(track, up)
    assert_allclose(found[:, :3], turn.apply(track[:, :3]), atol=1e-12)
    # The body's own axes stay what they are in the lab: only the lab's axes are turned, and the body's alike.
    assert_allclose(
        Rotation.from_quat(found[:, 3:]).as_matrix(), (turn * body * turn.inv()).as_matrix(), atol=1e-12
    )
    assert turned_up(track, "z") is track


def test_poses_between_rows_are_on_the_way_and_not_across_gaps() -> None:
    t_ns = np.array([0, 10, 20, 100], dtype=np.int64)
    turned = Rotation.from_euler("z", [[0.0], [0.2], [0.4], [0.6]]).as_quat()
    turned[1] *= -1.0  # the same rotation
    track = np.column_stack([[0.0, 1.0, 2.0, 3.0], np.zeros((4, 2)), turned])
    moments = np.array([-5, 0, 5, 15, 20, 50, 100, 105], dtype=np.int64)
    found = at_times(t_ns, track, moments, most_ns=50)
    assert_allclose(found[:, 0], [np.nan, 0.0, 0.5, 1.5, 2.0, np.nan, 3.0, np.nan])
    heading = Rotation.from_quat(found[[2, 3], 3:]).as_euler("xyz")[:, 2]
    assert_allclose(heading, [0.1, 0.3], atol=1e-6)
    # What was measured at a time stays as it is, bit for bit.
    assert found[4].tolist() == track[2].tolist()
    assert found[6].tolist() == track[3].tolist()
