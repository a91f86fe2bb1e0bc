from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.bounds.certified import Failed
from estimation.bounds.certified_positions import PositionCertifier
from estimation.bounds.sample_window import EMPTY_WINDOW, SampleWindow
from formation.angles import wrap

EPS, K_V, K_U, V_EPS = 1.5e-3, 0.1, 0.7, 0.04
STEP_NS = 8_333_333
CERTIFIER = PositionCertifier(EPS, K_V * K_U, (V_EPS, K_V), 1.0 / 120.0)
ROUNDING = 1e-6


@settings(max_examples=50)
@given(
    seed=st.integers(0, 10_000),
    v1=st.floats(V_EPS, K_V),
    switches=st.lists(st.integers(1, 110), max_size=4),
    edge=st.booleans(),
    loss=st.sampled_from([0.0, 0.1, 0.7]),
)
def test_the_truth_is_always_within_what_is_certain(
    seed: int, v1: float, switches: list[int], edge: bool, loss: float
) -> None:
    """Leaders that turn as hard as they may, one way and the other, positions as wrong as they may be."""
    random = np.random.default_rng(seed)
    turn, heading, leader = K_U * random.choice([-1.0, 1.0]), random.uniform(-math.pi, math.pi), 0.0 + 0.0j
    known, certified = EMPTY_WINDOW, 0
    dt, drift = STEP_NS * 1e-9, random.uniform(-9.0, 9.0)
    for frame in range(120):
        turn = -turn if frame in switches else turn
        # An arc is a chord at its mean heading, shorter by the sine of half its turn.
        half = 0.5 * turn * dt
        leader += v1 * dt * math.sin(half) / half * np.exp(1j * (heading + half))
        heading += 2.0 * half
        if random.random() < loss:
            continue
        follower = leader + 0.2 * np.exp(1j * (heading - 1.2))
        # Errors at random, or on the edge and turning slowly so that they look like motion.
        size, along = (
            (EPS, drift + 3.0 * frame * dt) if edge else (EPS * random.random(), random.uniform(-9, 9))
        )
        seen, behind = leader + size * np.exp(1j * along), follower - size * np.exp(1j * along)
        capture_ns = frame * STEP_NS
        known = CERTIFIER.add(known, capture_ns, (seen.real, seen.imag), (behind.real, behind.imag))
        found = CERTIFIER.certain(known, capture_ns)
        if found is Failed.GAP:
            continue
        assert not isinstance(found, Failed)
        certified += 1
        assert abs(v1 - found.v1.centre) <= found.v1.half + ROUNDING
        assert abs(wrap(-1.2 - found.alpha1.centre)) <= found.alpha1.half + ROUNDING
    assert certified > 20


def straight(frames: int) -> SampleWindow:
    known = EMPTY_WINDOW
    for frame in range(frames):
        at = (0.08 * frame * STEP_NS * 1e-9, 0.0)
        known = CERTIFIER.add(known, frame * STEP_NS, at, (at[0], -0.2))
    return known


def test_a_straight_leader_is_known_as_well_as_can_be() -> None:
    known = straight(120)
    found = PositionCertifier(EPS, K_V * K_U, (0.0, 1.0), 1.0 / 120.0).certain(known, 119 * STEP_NS)
    assert not isinstance(found, Failed)
    # The best window gives 2 sqrt(eps A), and nothing from the past can do better.
    least = 2.0 * math.sqrt(EPS * K_V * K_U)
    assert least <= found.v1.half + 1e-12
    assert found.v1.half < 1.01 * least
    assert abs(found.alpha1.centre + 0.5 * math.pi) < 1e-9
    # Only what can still tell something is kept.
    assert found.measurements == len(known.capture_ns) < 60


def test_nothing_is_certain_of_a_time_without_a_position() -> None:
    assert CERTIFIER.certain(EMPTY_WINDOW, 0) is Failed.UNSEEN
    assert CERTIFIER.certain(straight(50), 50 * STEP_NS) is Failed.UNSEEN
    assert CERTIFIER.certain(straight(1), 0) is Failed.GAP


def test_order_of_arrival_does_not_matter() -> None:
    known = straight(60)
    swapped = EMPTY_WINDOW
    for frame in [*range(50), *range(59, 49, -1)]:
        at = (0.08 * frame * STEP_NS * 1e-9, 0.0)
        swapped = CERTIFIER.add(swapped, frame * STEP_NS, at, (at[0], -0.2))
    assert CERTIFIER.certain(swapped, 59 * STEP_NS) == CERTIFIER.certain(known, 59 * STEP_NS)
