"""What a body beside the wheels' middle shows: how far it is, how surely, and nothing that is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.own_motion.odometry_check import WayEntry, Ways
from estimation.tracking.sideways_check import NO_SIDEWAYS_CHECK, SidewaysCheck, sideways_left, with_ways


def driven(
    y: float, seconds: float, seed: int = 0, *, turns: float = 0.6, scale: float = 1.0, slip: float = 0.0
) -> list[WayEntry]:
    """Ways every tenth of a second, by noisy odometry and a noisy track."""
    random, twist, track = np.random.default_rng(seed), np.zeros(2), np.zeros(2)
    entries = []
    for k in range(round(10 * seconds)):
        u = turns * math.sin(0.16 * k + seed)
        v = 0.1 + 0.02 * math.sin(0.05 * k + 2 * seed)
        noise = random.normal(size=4) * [3e-4, 3.5e-3, 2e-3 / math.sqrt(3.0), 0.01]
        wheels = Ways(*twist.tolist())
        shown = Ways(*(track + noise[:2]).tolist())
        entries.append(WayEntry(1 + k * 100_000_000, wheels, wheels, shown))
        twist += 0.1 * (np.array([scale * v + slip * abs(u), u]) + noise[2:])
        track += 0.1 * np.array([v - u * y, u])
    return entries


def found(check: SidewaysCheck) -> tuple[float, float]:
    left = sideways_left(check)
    assert left is not None
    return left


@pytest.mark.parametrize("scale", [1.0, 0.96])
def test_a_place_is_found_within_what_is_said_of_it(scale: float) -> None:
    errors = []
    for seed in range(20):
        place, sd = found(with_ways(NO_SIDEWAYS_CHECK, driven(0.03, 15.0, seed, scale=scale, slip=0.005)))
        assert sd < 0.003
        errors.append((place - 0.03) / sd)
    assert 0.5 < math.sqrt(np.mean(np.square(errors))) < 1.5


def test_windows_count_once_however_often_they_are_shown() -> None:
    entries = driven(0.02, 20.0)
    check = NO_SIDEWAYS_CHECK
    for end in range(10, len(entries) + 1, 5):
        check = with_ways(check, entries[max(0, end - 60) : end])
    assert check == with_ways(NO_SIDEWAYS_CHECK, entries[: len(entries) // 5 * 5])


def test_a_straight_line_and_little_motion_tell_nothing() -> None:
    assert sideways_left(with_ways(NO_SIDEWAYS_CHECK, driven(0.03, 20.0, turns=0.01))) is None
    assert sideways_left(with_ways(NO_SIDEWAYS_CHECK, driven(0.03, 4.0))) is None
