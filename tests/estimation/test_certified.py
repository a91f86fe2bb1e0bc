from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.certified import Interval, certain_alpha1, certain_motion
from formation.angles import wrap

EPS, K_V, K_U, V_EPS = 1.5e-3, 0.1, 0.7, 0.04


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    v1=st.floats(V_EPS, K_V),
    switch=st.floats(-0.6, 0.0),
    turns=st.tuples(st.sampled_from([-K_U, 0.0, K_U]), st.sampled_from([-K_U, K_U])),
    edge=st.booleans(),
)
def test_the_truth_is_always_within_what_is_certain(
    seed: int, v1: float, switch: float, turns: tuple[float, float], edge: bool
) -> None:
    random = np.random.default_rng(seed)
    times = np.arange(-72, 1) / 120.0
    heading0 = random.uniform(-math.pi, math.pi)
    fine = np.linspace(times[0], 0.0, 7201)
    turn = np.where(fine < switch, *turns)
    heading = heading0 + np.concatenate([[0.0], np.cumsum(turn[:-1] * np.diff(fine))])
    steps = v1 * np.exp(1j * 0.5 * (heading[1:] + heading[:-1])) * np.diff(fine)
    path = np.concatenate([[0.0], np.cumsum(steps)])[::100]
    noise = (
        EPS * (1.0 if edge else random.random(len(path))) * np.exp(1j * random.uniform(-9.0, 9.0, len(path)))
    )
    seen = path + noise
    found = certain_motion(times, np.column_stack([seen.real, seen.imag]), EPS, K_V * K_U, (V_EPS, K_V))
    assert found is not None
    assert abs(v1 - found.speed.centre) <= found.speed.half + 1e-9
    assert abs(wrap(float(heading[-1]) - found.direction.centre)) <= found.direction.half + 1e-6
    follower = path[-1] + 0.2j
    measured = follower + EPS * np.exp(1j * random.uniform(-9.0, 9.0))
    alpha1 = certain_alpha1(
        found, np.array([seen[-1].real, seen[-1].imag]), np.array([measured.real, measured.imag]), EPS
    )
    truth = wrap(float(np.angle(follower - path[-1])) - float(heading[-1]))
    assert abs(wrap(truth - alpha1.centre)) <= alpha1.half + 1e-6


def test_the_worst_noise_and_turn_come_to_the_edge() -> None:
    """Straight positions that a difference over the best window misjudges as much as it ever can."""
    acceleration = 0.07
    window = 2.0 * math.sqrt(EPS / acceleration)
    positions = np.array([[0.0, 0.0], [0.08 * window, 0.0]])
    found = certain_motion(np.array([-window, 0.0]), positions, EPS, acceleration, (0.0, 1.0))
    assert found is not None
    assert found.speed.half == pytest.approx(2.0 * math.sqrt(EPS * acceleration))
    assert found.direction.half == pytest.approx(math.asin(found.speed.half / 0.08))


def test_contradictions_are_told() -> None:
    jump = np.array([[0.0, 0.0], [0.5, 0.0]])
    assert certain_motion(np.array([0.0, 0.1]), jump, EPS, 0.07, (V_EPS, K_V)) is None
    assert certain_motion(np.array([0.0]), jump[:1], EPS, 0.07, (V_EPS, K_V)) is None


def test_radius_is_the_distance_to_the_farthest_possible_value() -> None:
    assert Interval(1.0, 0.5).radius(2.0) == pytest.approx(1.5)
    assert Interval(3.1, 0.1).radius(-3.1, on_circle=True) == pytest.approx(0.1 + 2.0 * math.pi - 6.2)
    assert Interval(0.0, math.pi).radius(1.0, on_circle=True) == math.pi
