"""The virtual leader: what it takes from its neighbours, and that it moves as it says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.virtual_leader import virtual_leader
from formation.angles import wrap
from formation.pose import Motion, Pose, advance

poses = st.builds(Pose, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-0.7, 0.7))
motions = st.builds(Motion, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
flocks = st.lists(st.tuples(poses, motions), min_size=1, max_size=6)


@given(poses, motions)
def test_one_neighbour_is_its_own_virtual_leader(pose: Pose, motion: Motion) -> None:
    found, moving = virtual_leader([pose], [motion])
    assert (found.x, found.y, found.theta) == pytest.approx((pose.x, pose.y, pose.theta), abs=1e-15)
    assert (moving.v, moving.u) == pytest.approx((motion.v, motion.u))


@given(flocks)
def test_it_moves_as_it_says_but_for_the_drift(flock: list[tuple[Pose, Motion]]) -> None:
    now, moving = virtual_leader([pose for pose, _ in flock], [motion for _, motion in flock])
    h, seen = 1e-4, []
    for side in (-h, h):
        moved = [advance(pose, motion.v, motion.u, side) for pose, motion in flock]
        seen.append(virtual_leader(moved, [motion for _, motion in flock])[0])
    before, after = seen
    vx, vy = (after.x - before.x) / (2.0 * h), (after.y - before.y) / (2.0 * h)
    assert wrap(after.theta - before.theta) / (2.0 * h) == pytest.approx(moving.u, abs=1e-5)
    assert vx * math.cos(now.theta) + vy * math.sin(now.theta) == pytest.approx(moving.v, abs=1e-6)
    drift = np.mean([(motion.v - moving.v) * math.sin(pose.theta - now.theta) for pose, motion in flock])
    assert vy * math.cos(now.theta) - vx * math.sin(now.theta) == pytest.approx(drift, abs=1e-6)


@given(st.floats(-3.0, 3.0))
def test_headings_are_averaged_on_the_circle(turn: float) -> None:
    headings = [wrap(math.pi - 0.1 + turn), wrap(-math.pi + 0.3 + turn)]
    found, _ = virtual_leader([Pose(0.0, 0.0, theta) for theta in headings], [Motion(1.0, 0.0)] * 2)
    assert wrap(found.theta - turn) == pytest.approx(-math.pi + 0.1)


def test_what_has_no_mean_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        virtual_leader([], [])
    opposite = [Pose(0.0, 0.0, 0.5), Pose(1.0, 0.0, 0.5 + math.pi)]
    with pytest.raises(ValueError, match="cancel"):
        virtual_leader(opposite, [Motion(1.0, 0.0)] * 2)
    with pytest.raises(ValueError, match="zip"):
        virtual_leader(opposite[:1], [Motion(1.0, 0.0)] * 2)
