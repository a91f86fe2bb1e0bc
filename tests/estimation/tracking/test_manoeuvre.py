"""A leader that changes its motion at once is noticed by its innovations, and outliers are not it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, Spread
from estimation.models.measurement import Measurement, PoseNoise, measure_world
from estimation.tracking.manoeuvre import (
    JUDGED,
    LARGEST_SHARE,
    LASTS,
    REMEMBERED,
    SPEED_ALARM,
    SPEED_RAISED,
    TURN_ALARM,
    TURN_JUMPY,
    TURN_LEAN,
    Manoeuvre,
    later,
    noticed,
    raised,
    steady,
)
from formation.pose import Pose

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
NOISE = ProcessNoise.by_rule(LIMITS, 0.1, 1e-4)
SD, FRAME = 1e-3, 1.0 / 120.0
angles = st.floats(-math.pi, math.pi)


def prior(heading: float, speed: float = 0.08) -> Gaussian:
    """Predicted at the origin, so well known that what is seen elsewhere is all noise or news."""
    mean = np.array([0.0, 0.0, speed * math.cos(heading), speed * math.sin(heading), 0.0])
    return Gaussian.of(mean, np.diag([1e-12, 1e-12, 1e-8, 1e-8, 1e-2]))


def seen(heading: float, along: float, across: float) -> Measurement:
    """So many standard deviations ahead and to the left."""
    c, s = math.cos(heading), math.sin(heading)
    place = SD * (c * along - s * across), SD * (s * along + c * across)
    still = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    return measure_world(0, place, Pose(1.0, 1.0, 0.0), PoseNoise(SD, 0.01), still)


def after(innovations: list[tuple[float, float]], heading: float = 0.3) -> tuple[Manoeuvre, Gaussian]:
    manoeuvre, belief = steady()._replace(settled_for=2.0), prior(heading)
    for along, across in innovations:
        manoeuvre = later(manoeuvre, FRAME, True)
        manoeuvre, belief = noticed(manoeuvre, prior(heading), seen(heading, along, across), NOISE, LIMITS)
    return manoeuvre, belief


@given(angles, st.sampled_from([-1.0, 1.0]))
def test_a_run_along_raises_the_noise_of_the_speed_and_one_across_that_of_the_turning(
    heading: float, side: float
) -> None:
    along, wider = after([(2.0 * side, 0.0)] * 7, heading)
    assert (along.speed_raised, along.unjudged, along.turn_raised) == (LASTS, JUDGED, 0.0)
    across, unsure = after([(0.0, 2.0 * side)] * 9, heading)
    assert (across.turn_raised, across.turn_jumps, across.speed_raised) == (LASTS, 0.8, 0.0)
    noise = raised(NOISE, along, LIMITS)
    assert noise.q_v > 100.0 * NOISE.q_v
    assert noise.q_u == NOISE.q_u
    assert raised(NOISE, across, LIMITS).q_u > 5.0 * NOISE.q_u
    ahead = np.array([math.cos(heading), math.sin(heading)])
    grown = wider.covariance[2:4, 2:4] - prior(heading).covariance[2:4, 2:4]
    aside = np.array([-ahead[1], ahead[0]])
    assert grown @ aside == pytest.approx(np.zeros(2), abs=1e-12)
    assert ahead @ grown @ ahead > 0.0
    # Turning makes the direction unsure, by the turn rate and together with it, and not the speed.
    turned = unsure.covariance[2:, 2:] - prior(heading).covariance[2:, 2:]
    assert turned[:2, :2] @ ahead == pytest.approx(np.zeros(2), abs=1e-12)
    assert ahead @ turned[:2, 2] == pytest.approx(0.0, abs=1e-12)
    assert turned[2, 2] > 0.0
    assert np.linalg.eigvalsh(turned).min() > -1e-12
    time = 2.0 * (aside @ turned[:2, 2]) / (0.08 * turned[2, 2])
    assert aside @ turned[:2, :2] @ aside == pytest.approx(0.08**2 * turned[2, 2] * time**2 / 3.0)
    assert time <= LASTS


def test_outliers_alone_are_no_manoeuvre() -> None:
    """Not two in a row, however large, nor one now and then."""
    assert 2.0 * (LARGEST_SHARE - 0.5) < SPEED_ALARM
    assert 2.0 * TURN_LEAN * (LARGEST_SHARE - 0.5 * TURN_LEAN) < TURN_ALARM
    for outliers in ([(1e6, 1e6)] * 2, [(1e6, -1e6), *[(0.0, 0.0)] * 11] * 20):
        manoeuvre, _ = after(outliers)
        assert (manoeuvre.speed_raised, manoeuvre.unjudged, manoeuvre.turn_jumps) == (0.0, 0.0, 0.0)


def test_noise_hardly_ever_makes_an_alarm() -> None:
    generator, count = np.random.default_rng(5), 0
    manoeuvre, n = steady()._replace(settled_for=2.0), 20_000
    for along, across in generator.standard_normal((n, 2)).tolist():
        manoeuvre = later(manoeuvre, FRAME, True)._replace(speed_raised=0.0, turn_jumps=0.0)
        manoeuvre, _ = noticed(manoeuvre, prior(0.3), seen(0.3, along, across), NOISE, LIMITS)
        assert manoeuvre.speed_jumps == 0.0
        count += (manoeuvre.speed_raised > 0.0) + (manoeuvre.turn_jumps > 0.0)
    assert 0 < count < n / 500


@given(st.floats(-0.05, 0.05))
def test_an_alarm_counts_as_a_jump_if_the_speed_is_another_one_afterwards(step: float) -> None:
    """The prior's speed is known to 0.1 mm/s, before and after."""
    manoeuvre = steady()._replace(settled_for=2.0)
    manoeuvre, _ = noticed(manoeuvre, prior(0.3), seen(0.3, 0.0, 0.0), NOISE, LIMITS)
    for _ in range(7):
        manoeuvre = later(manoeuvre, FRAME, True)
        manoeuvre, _ = noticed(manoeuvre, prior(0.3), seen(0.3, 2.0, 0.0), NOISE, LIMITS)
    assert manoeuvre.speed_raised == LASTS
    there = prior(0.3, 0.08 + step)
    soon, _ = noticed(later(manoeuvre, 0.9 * JUDGED, True), there, seen(0.3, 0.0, 0.0), NOISE, LIMITS)
    counts = abs(step) > 3.0 * math.sqrt(2.0) * 1e-4
    assert soon.jumps == (1.0 if counts else 0.0)
    assert soon.speed_jumps == pytest.approx(step**2 - 2e-8 if counts else 0.0)
    late, _ = noticed(later(manoeuvre, 1.1 * JUDGED, True), there, seen(0.3, 0.0, 0.0), NOISE, LIMITS)
    assert (late.unjudged, late.jumps, late.speed_jumps) == (0.0, 0.0, 0.0)


def test_a_jump_counts_once_and_by_the_most_that_the_speed_is_off_by() -> None:
    manoeuvre = after([(0.0, 0.0), *[(2.0, 0.0)] * 7])[0]
    for step in (0.005, 0.01, 0.03, 0.02):
        there = prior(0.3, 0.08 + step)
        manoeuvre, _ = noticed(later(manoeuvre, FRAME, True), there, seen(0.3, 0.0, 0.0), NOISE, LIMITS)
    assert manoeuvre.jumps == pytest.approx(1.0, abs=0.01)
    assert manoeuvre.speed_jumps == pytest.approx(0.03**2, rel=0.01)


@given(st.floats(0.01, 0.05), st.floats(0.5, 4.0))
def test_a_leader_known_to_jump_is_driven_by_the_squares_of_its_jumps_per_time(
    size: float, every: float
) -> None:
    manoeuvre = steady()
    for k in range(round(90.0 / FRAME)):
        manoeuvre = later(manoeuvre, FRAME, True)
        if k % round(every / FRAME) == 0:
            grown = manoeuvre.speed_jumps + size * size
            manoeuvre = manoeuvre._replace(speed_jumps=grown)
    highest = SPEED_RAISED * LIMITS.k_v**2
    # Just before or after a jump it is a little less or more.
    expected = pytest.approx(min(highest, size**2 / every), rel=1.2 * every / REMEMBERED)
    assert raised(NOISE, manoeuvre, LIMITS).q_v == expected


def test_what_is_raised_falls_back_and_that_a_leader_jumps_is_forgotten_slowly() -> None:
    manoeuvre = after([(2.0, 2.0)] * 9)[0]._replace(speed_jumps=4e-4)
    soon, late = later(manoeuvre, 1.5 * LASTS, True), later(manoeuvre, REMEMBERED, True)
    assert (soon.speed_raised, soon.turn_raised) == (0.0, 0.0)
    jumpy = ProcessNoise.by_rule(LIMITS, 0.8 * TURN_JUMPY)
    assert raised(NOISE, soon, LIMITS).q_v == pytest.approx(4e-4, rel=0.02)
    assert raised(NOISE, soon, LIMITS).q_u == pytest.approx(jumpy.q_u, rel=0.02)
    assert raised(NOISE, late, LIMITS) == NOISE
    assert raised(NOISE, steady(), LIMITS) == NOISE


def test_a_leader_that_stands_has_no_direction_to_tell_a_run_by() -> None:
    started = steady()._replace(ahead=7.0, behind=7.0, left=7.0, right=7.0, running=0.1, settled_for=2.0)
    for speed in (0.0, 0.4 * LIMITS.v_eps):
        found, belief = noticed(started, prior(0.3, speed), seen(0.3, 3.0, 3.0), NOISE, LIMITS)
        assert (found.ahead, found.behind, found.left, found.right) == (0.0, 0.0, 0.0, 0.0)
        assert belief == prior(0.3, speed)


def test_an_innovation_counts_by_the_spread_in_its_direction() -> None:
    """Along the long axis of a spread ten times as wide three deviations are a third of one."""
    wide = seen(0.0, 3.0, 0.0)._replace(spread=Spread(100.0 * SD * SD, 0.0, SD * SD))
    found, _ = noticed(steady(), prior(0.0), wide, NOISE, LIMITS)
    assert found.ahead == 0.0
    narrow = wide._replace(spread=Spread(SD * SD, 0.0, 100.0 * SD * SD))
    assert noticed(steady(), prior(0.0), narrow, NOISE, LIMITS).manoeuvre.ahead == pytest.approx(
        2.5, abs=1e-4
    )
