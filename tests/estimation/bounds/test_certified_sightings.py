from __future__ import annotations

import cmath
import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from estimation.bounds.certified import Certain, Failed
from estimation.bounds.certified_sightings import SightingCertifier, SightingErrors, velocity_error
from estimation.bounds.sample_window import EMPTY_WINDOW, SampleWindow
from estimation.own_motion.odometry_history import History, MotionSample
from formation.angles import FloatArray, wrap

ERRORS = SightingErrors(E_rho=2e-3, E_alpha2=0.01, M_v2=3e-3, M_u2=0.02)
K_V, K_U, V_EPS = 0.1, 0.7, 0.04
STEP, STEP_NS, EPOCH_NS = 0.02, 20_000_000, 1_700_000_000_000_000_000
FINE = 20
ROUNDING = 1e-5  # the fine steps of the path are chords
CERTIFIER = SightingCertifier(ERRORS, K_V * K_U, (V_EPS, K_V), 0.2, 0.22, STEP)


def path(v: FloatArray, u: FloatArray, heading: float) -> tuple[NDArray[np.complex128], FloatArray]:
    """Places and headings of a robot from the origin on, from its motion in fine steps."""
    dt = STEP / FINE
    headings = heading + np.concatenate([[0.0], np.cumsum(u * dt)])
    steps = v * dt * np.exp(0.5j * (headings[1:] + headings[:-1]))
    return np.concatenate([[0.0], np.cumsum(steps)]), headings


def fed(
    odometry: History, sightings: Iterable[tuple[int, float, float]]
) -> tuple[SampleWindow, list[Certain | Failed]]:
    known, found = EMPTY_WINDOW, []
    for capture_ns, rho, alpha2 in sightings:
        known = CERTIFIER.add(known, capture_ns, rho, alpha2)
        heard = tuple(sample for sample in odometry if sample.stamp_ns <= capture_ns)
        found.append(CERTIFIER.certain(known, heard, capture_ns))
    return known, found


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    v1=st.floats(V_EPS, K_V),
    switches=st.lists(st.integers(1, 60), max_size=3),
    signs=st.tuples(st.sampled_from([-1.0, 1.0]), st.sampled_from([-1.0, 1.0])),
    edge=st.booleans(),
)
def test_the_truth_is_always_within_what_is_certain(
    seed: int, v1: float, switches: list[int], signs: tuple[float, float], edge: bool
) -> None:
    """Leaders that turn as hard as they may; sensors and, all along, odometry as wrong as they may be."""
    random, ticks = np.random.default_rng(seed), np.arange(66)
    fine = np.arange(0.5, 65 * FINE) / FINE
    turn = np.where((seed + np.searchsorted(np.sort(switches), fine)) % 2, -K_U, K_U)
    leader, heading = path(np.full(len(fine), v1), turn, random.uniform(-3.0, 3.0))
    # The follower's motion is linear between the samples that odometry takes of it.
    pulse, later = random.uniform(0.2, 2.0, 2) * STEP, random.uniform(-3.0, 3.0)
    v2, u2 = 0.12 + 0.08 * np.sin(pulse[0] * ticks), 0.8 * np.cos(pulse[1] * ticks + later)
    follower, own = path(np.interp(fine, ticks, v2), np.interp(fine, ticks, u2), heading[0] + 0.3)
    line = (leader - follower - 0.25j * np.exp(1j * heading[0]))[::FINE]
    heading, own = heading[::FINE], own[::FINE]
    wrong = np.ones((4, len(ticks))) if edge else random.random((4, len(ticks)))
    odometry_v = v2 + signs[0] * wrong[0] * ERRORS.M_v2
    odometry_u = u2 + signs[1] * wrong[1] * ERRORS.M_u2
    odometry = tuple(
        MotionSample(EPOCH_NS + tick * STEP_NS, v, u)
        for tick, v, u in zip(ticks.tolist(), odometry_v.tolist(), odometry_u.tolist(), strict=True)
    )
    either = random.choice([-1.0, 1.0], (2, len(ticks)))
    rho = np.abs(line) + either[0] * wrong[2] * ERRORS.E_rho
    alpha2 = np.angle(line) - own + either[1] * wrong[3] * ERRORS.E_alpha2
    seen = zip((EPOCH_NS + ticks * STEP_NS).tolist(), rho.tolist(), alpha2.tolist(), strict=True)
    _, found = fed(odometry, seen)
    assert found[0] is Failed.GAP
    for tick, certain in enumerate(found[1:], start=1):
        assert not isinstance(certain, Failed)
        assert abs(v1 - certain.v1.centre) <= certain.v1.half + ROUNDING
        alpha1 = float(np.angle(-line[tick]) - heading[tick])
        assert abs(wrap(alpha1 - certain.alpha1.centre)) <= certain.alpha1.half + ROUNDING


def test_a_follower_that_swerves_between_rare_samples_takes_nothing_from_certainty() -> None:
    """Exact odometry ten times a second, linear in between: what it says of the way is exact as well."""
    exact, held = SightingErrors(1e-4, 1e-4, 2e-5, 2e-5), 5
    certifier = SightingCertifier(exact, 0.005, (V_EPS, K_V), 0.2, 0.22, held * STEP)
    ticks = np.arange(0, 101, held)
    v2, u2 = 0.15 + 0.05 * (-1.0) ** np.arange(21), 2.5 * (-1.0) ** (np.arange(21) // 2)
    fine = np.arange(0.5, 100 * FINE) / FINE
    follower, own = path(np.interp(fine, ticks, v2), np.interp(fine, ticks, u2), 0.0)
    leader = np.linspace(0.0, 0.06 * 100 * STEP, len(follower)) + 0.25j
    captures = (EPOCH_NS + ticks * STEP_NS).tolist()
    odometry = tuple(map(MotionSample, captures, v2.tolist(), u2.tolist()))
    line = (leader - follower)[:: held * FINE] * np.exp(-1j * own[:: held * FINE])
    known = EMPTY_WINDOW
    for row, (capture_ns, to_leader) in enumerate(zip(captures, line.tolist(), strict=True)):
        known = certifier.add(known, capture_ns, abs(to_leader), cmath.phase(to_leader))
        certain = certifier.certain(known, odometry[: row + 1], capture_ns)
        if row:
            assert isinstance(certain, Certain)
            alpha1 = cmath.phase(-to_leader) + float(own[row * held * FINE])
            assert abs(0.06 - certain.v1.centre) <= certain.v1.half
            assert abs(wrap(alpha1 - certain.alpha1.centre)) <= certain.alpha1.half


def abreast(frames: int) -> tuple[History, list[tuple[int, float, float]]]:
    """Both drive straight and side by side, the leader to the left of the follower."""
    captures = [EPOCH_NS + frame * STEP_NS for frame in range(frames)]
    return tuple(MotionSample(at, 0.08, 0.0) for at in captures), [
        (at, 0.2, 0.5 * math.pi) for at in captures
    ]


def test_the_radius_comes_down_to_the_least_there_is() -> None:
    odometry, sightings = abreast(90)
    known, found = fed(odometry, sightings)
    loose = SightingCertifier(ERRORS, K_V * K_U, (0.0, 1.0), 0.2, 0.22, STEP)
    certain = loose.certain(known, odometry, sightings[-1][0])
    assert isinstance(certain, Certain)
    assert certain.v1.half == pytest.approx(velocity_error(ERRORS, K_V * K_U, 0.2, 0.08), rel=0.01)
    assert certain.alpha1.centre == pytest.approx(-0.5 * math.pi)
    assert isinstance(found[-1], Certain)
    assert found[-1].v1.half <= 0.5 * (K_V - V_EPS)


def test_without_odometry_nothing_is_certain() -> None:
    odometry, sightings = abreast(60)
    known, _ = fed(odometry, sightings)
    now_ns = sightings[-1][0]
    assert CERTIFIER.certain(known, (), now_ns) is Failed.GAP
    assert CERTIFIER.certain(known, odometry[:50], now_ns) is Failed.GAP
    assert (
        CERTIFIER.certain(known, tuple(MotionSample(now_ns + 1, 0.08, 0.0) for _ in "1"), now_ns)
        is Failed.GAP
    )
    assert CERTIFIER.certain(known, odometry, now_ns + STEP_NS) is Failed.UNSEEN
    assert isinstance(CERTIFIER.certain(known, odometry[-10:], now_ns), Certain)
