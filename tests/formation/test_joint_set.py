from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.error_set import error_set
from formation.error_set_kernels import ErrorModel
from formation.joint_set import Aside, JointSet, joint_set, largest_error, tube_holds, tube_radii
from formation.joint_set_kernels import (
    Outline,
    Pointing,
    Spot,
    Tube,
    outermost_turn,
    outward_at,
    worst_across,
)
from formation.kernel import interpreted
from formation.shape import ABREAST_ALPHA1
from tests.bits import same_bits

MODEL = ErrorModel(1.5, 0.2, 20.0, 0.08, 0.7, 0.015)
ASIDE = Aside(2.0)


def f(rho: np.ndarray) -> np.ndarray:
    return np.asarray(20.0 * (rho**2 - 0.04) / rho**2)


def rates(state: np.ndarray, error: np.ndarray, u1: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """The paper's (3) under (4) and (8) on a wrong velocity, written out; rows rho, alpha1, alpha2.

    The error is complex, in the frame where the leader's velocity is v1 exp(i alpha1); ``driven`` is what the
    speed is off by.
    """
    rho, alpha1, alpha2 = state
    seen = MODEL.v1 * np.exp(1j * alpha1) + error
    speed, angle = np.abs(seen), np.angle(seen)
    asked = -speed * np.sin(angle) + rho * (-MODEL.mu1 * np.cos(angle) + speed * f(rho))
    v2 = asked + driven
    u2 = -ASIDE.mu2 * np.cos(alpha2) + (speed * np.sin(angle) + v2 * np.sin(alpha2)) / rho
    turn = (MODEL.v1 * np.sin(alpha1) + v2 * np.sin(alpha2)) / rho
    return np.array([-MODEL.v1 * np.cos(alpha1) - v2 * np.cos(alpha2), turn - u1, turn - u2])


@pytest.fixture(scope="module")
def held() -> JointSet:
    found = joint_set(MODEL, ASIDE)
    assert found is not None
    return found


def edges(held: JointSet, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (rho, theta) drawn on pieces of the outline, and outward normals along (rho / rho_0, theta)."""
    random = np.random.default_rng(seed)
    places, normals = [], []
    for (rhos, thetas), side in ((held.low, 1.0), (held.high, -1.0)):
        k = random.integers(0, len(rhos) - 1, n)
        ahead, up = (rhos[k + 1] - rhos[k]) / MODEL.rho_0, thetas[k + 1] - thetas[k]
        share = random.random(n)
        places.append([rhos[k] + share * (rhos[k + 1] - rhos[k]), thetas[k] + share * up])
        normals.append(side * np.array([up, -ahead]) / np.hypot(ahead, up))
    return np.concatenate(places, axis=1), np.concatenate(normals, axis=1)


def test_the_robots_with_three_quarters_of_the_error_keep_all_three(held: JointSet) -> None:
    assert held.inward > 0.0
    assert 0.10 < held.rho_min < 0.115
    assert 0.42 < held.rho_max < 0.45
    ball = math.asin(MODEL.W / held.rho_min / ASIDE.mu2)
    assert ball <= held.alpha2_within <= 1.02 * ball
    assert held.alpha1_min < ABREAST_ALPHA1 - 2.0
    assert held.alpha1_max > ABREAST_ALPHA1 + 1.5


def test_no_admitted_motion_points_out_of_the_outline(held: JointSet) -> None:
    (rho, theta), normal = edges(held, 20_000, 3)
    random, n = np.random.default_rng(4), len(rho)
    for _ in range(20):
        alpha2 = 0.5 * math.pi + held.radius(rho) * random.choice([-1.0, 1.0, 0.3], n)
        error = MODEL.W * np.exp(2j * math.pi * random.random(n)) * random.choice([1.0, 0.5], n)
        u1 = MODEL.k_u * random.choice([-1.0, 1.0], n)
        state = np.array([rho, theta + ABREAST_ALPHA1, alpha2])
        found = rates(state, error, u1, np.zeros(n))
        assert np.all(normal[0] * found[0] / MODEL.rho_0 + normal[1] * found[1] < 0.0)


def test_nothing_gets_out_and_alpha2_comes_near_its_radius(held: JointSet) -> None:
    """Runge and Kutta's fourth order on (3); leaders and errors push against the nearest edge."""
    n, h, random = 400, 0.01, np.random.default_rng(8)
    (rho, theta), _ = edges(held, n // 2, 9)
    off = held.radius(rho) * random.choice([-1.0, 1.0], n)
    state = np.array([rho, theta + ABREAST_ALPHA1, 0.5 * math.pi + off])
    still, reached = np.zeros(n), 0.0
    rim = MODEL.W * np.exp(2j * math.pi * np.arange(16) / 16.0)
    for step in range(1500):
        if step % 4 == 0:
            side = np.where(state[1] >= ABREAST_ALPHA1, 1.0, -1.0)
            pulls = np.array([side * rates(state, np.full(n, e), still, still)[1] for e in rim])
            worst = rim[np.argmax(pulls, axis=0)]
            # A third holds what moves alpha2 most, an error across the line.
            across = 1j * MODEL.W * np.where(np.arange(n) % 2, 1.0, -1.0)
            error = np.where(np.arange(n) % 3 == 0, across, worst)
            u1 = -MODEL.k_u * side
        k1 = rates(state, error, u1, still)
        k2 = rates(state + 0.5 * h * k1, error, u1, still)
        k3 = rates(state + 0.5 * h * k2, error, u1, still)
        k4 = rates(state + h * k3, error, u1, still)
        state = state + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        assert np.all(held.contains(state[0], state[1], 1e-5))
        within = np.abs(state[2] - 0.5 * math.pi) / held.radius(state[0])
        assert np.all(within < 1.0 + 1e-6)
        reached = max(reached, float(within[::3].max())) if step > 500 else reached
    assert reached > 0.8


@settings(deadline=None, max_examples=80)
@given(
    st.floats(0.1, 0.5),
    st.floats(-2.5, 2.5),
    st.floats(0.0, 0.3),
    st.floats(-math.pi, math.pi),
    st.floats(1e-4, 0.04),
    st.sampled_from([0.0, 0.03]),
)
def test_the_outward_speed_is_bounded_from_above_and_closely(
    rho: float, theta: float, radius: float, angle: float, error: float, dv: float
) -> None:
    """Against a dense maximum over rim, alpha2, steering and what is driven."""
    circle = error * np.exp(2j * math.pi * np.arange(720) / 720.0)
    alpha2: np.ndarray = 0.5 * math.pi + radius * np.linspace(-1.0, 1.0, 41)[:, np.newaxis]
    normal = math.cos(angle), math.sin(angle)
    brute = -math.inf
    for driven in (-dv, dv):
        for u1 in (-0.7, 0.7):
            state = np.array(
                [
                    np.full((41, 720), rho),
                    np.full((41, 720), theta + ABREAST_ALPHA1),
                    alpha2 + 0.0 * circle.real,
                ]
            )
            found = rates(
                state, circle + np.zeros((41, 1)), np.full((41, 720), u1), np.full((41, 720), driven)
            )
            brute = max(brute, float((normal[0] * found[0] / 0.2 + normal[1] * found[1]).max()))
    bound = outward_at(Spot(rho, theta, radius), Pointing(*normal), dv, MODEL._replace(W=error))
    assert brute <= bound + 1e-12
    # What the grids leave: a fraction of each second derivative.
    assert bound <= brute + 2e-3 * (1.0 + abs(float(f(np.array(rho)))) * 0.1)


def test_the_radii_keep_alpha2_wherever_the_pair_may_drive(held: JointSet) -> None:
    """Against the true rates at drawn places: on its edge alpha2 comes in as fast as the radius falls."""
    random, n = np.random.default_rng(12), 100_000
    rho = random.uniform(held.rho_min, held.rho_max, n)
    alpha1 = random.uniform(*held.span(rho))
    for side in (-1.0, 1.0):
        error = MODEL.W * np.exp(2j * math.pi * random.random(n))
        error[::2] = 1j * MODEL.W * random.choice([-1.0, 1.0], len(error[::2]))
        state = np.array([rho, alpha1, 0.5 * math.pi + side * held.radius(rho)])
        found = rates(state, error, np.zeros(n), np.zeros(n))
        slope = (held.radius(rho + 1e-6) - held.radius(rho - 1e-6)) / 2e-6
        assert np.all(side * found[2] < slope * found[0])


def test_radii_that_are_too_small_or_fall_too_fast_are_refused() -> None:
    table = tube_radii(MODEL, ASIDE, 0.11)
    assert table is not None
    radii, tube = table
    assert tube_holds(MODEL, ASIDE, radii, tube)
    assert not tube_holds(MODEL, ASIDE, 0.999 * radii, tube)
    assert not tube_holds(MODEL, ASIDE, radii[::-1].copy(), tube)
    assert not tube_holds(MODEL, Aside(1.999), radii, tube)
    assert not tube_holds(MODEL, Aside(2.0, du=1e-3), radii, tube)
    assert not tube_holds(MODEL, Aside(2.0, dv=0.01), radii, tube)
    assert not tube_holds(MODEL._replace(W=0.01501), ASIDE, radii, tube)
    constant = np.full_like(radii, radii[0])
    assert tube_holds(MODEL, ASIDE, constant, tube), "the ball of the least distance will do everywhere"


def test_where_the_error_outweighs_the_steering_there_are_no_radii() -> None:
    assert tube_radii(MODEL, Aside(MODEL.W / 0.11), 0.11) is None
    assert tube_radii(MODEL, Aside(1.0, du=1.0), 0.11) is None


def test_an_outline_that_is_drawn_in_or_meets_more_is_refused(held: JointSet) -> None:
    rhos = np.concatenate([held.low[0], held.high[0][::-1]])
    thetas = np.concatenate([held.low[1], held.high[1][::-1]])
    keep = np.append(True, (np.diff(rhos) != 0.0) | (np.diff(thetas) != 0.0))
    keep[-1] = False
    rhos, thetas = rhos[keep], thetas[keep]
    places, radii = held.radii
    tube = Tube(float(places[0]), float(places[1] - places[0]), 0.0)

    def worst(thetas: np.ndarray, model: ErrorModel = MODEL, tube: Tube = tube, more: float = 1.0) -> float:
        return worst_across(rhos, thetas, len(rhos), more * radii, tube, model)

    assert worst(thetas) < 0.0
    assert worst(0.998 * thetas) > 0.0
    assert worst(thetas, MODEL._replace(W=0.016)) > 0.0
    assert worst(thetas, MODEL._replace(k_u=0.71)) > 0.0
    assert worst(thetas, tube=tube._replace(dv=2e-3)) > 0.0
    assert worst(thetas, more=1.3) > 0.0
    assert worst(-thetas) > 0.0, "the wrong way round"


@pytest.mark.parametrize("error", [0.01, 0.017])
def test_with_alpha2_held_fast_it_is_the_set_on_the_manifold(error: float) -> None:
    plane, joint = error_set(MODEL._replace(W=error)), joint_set(MODEL._replace(W=error), Aside(1e6))
    assert plane is not None
    assert joint is not None
    assert joint.rho_min == pytest.approx(plane.inside.rho_min, abs=1e-3)
    assert joint.rho_max == pytest.approx(plane.inside.rho_max, abs=2e-3)
    assert joint.alpha1_max == pytest.approx(ABREAST_ALPHA1 + float(plane.inside.inward[1].max()), abs=2e-2)
    assert joint.alpha1_min == pytest.approx(ABREAST_ALPHA1 - float(plane.inside.outward[1].max()), abs=2e-2)


def test_less_error_or_stiffer_steering_has_a_smaller_set(held: JointSet) -> None:
    for model, aside in ((MODEL._replace(W=0.012), ASIDE), (MODEL, Aside(4.0))):
        inner = joint_set(model, aside)
        assert inner is not None
        for rhos, thetas in (inner.low, inner.high):
            assert np.all(held.contains(rhos, thetas + ABREAST_ALPHA1, 1e-9))
        assert inner.alpha2_within < held.alpha2_within
    clumsy = joint_set(MODEL._replace(W=0.01), Aside(2.0, dv=0.005, du=0.01))
    smooth = joint_set(MODEL._replace(W=0.01), ASIDE)
    assert clumsy is not None
    assert smooth is not None
    assert clumsy.rho_min < smooth.rho_min < smooth.rho_max < clumsy.rho_max


def test_truncated_commands_are_an_error_like_any_other() -> None:
    """Speeds cut by 0.01 m/s, turn rates by 0.01 rad/s; the cut speed turns the line by v / rho besides."""
    cut = 0.01
    held = joint_set(MODEL._replace(W=0.005), Aside(2.0, dv=cut, du=0.09))
    assert held is not None
    assert cut + cut / held.rho_min < 0.09


def test_what_cannot_be_held_is_not_claimed() -> None:
    robots = MODEL._replace(W=0.0205)
    assert joint_set(robots, ASIDE) is None
    assert joint_set(MODEL._replace(W=0.09), ASIDE) is None
    assert joint_set(MODEL, Aside(0.1)) is None
    assert joint_set(MODEL._replace(k_u=1.25), ASIDE) is None
    most = largest_error(robots, ASIDE)
    assert 0.0148 < most < 0.0155
    assert joint_set(MODEL._replace(W=0.99 * most), ASIDE) is not None


def test_places_beyond_the_edge_are_not_contained(held: JointSet) -> None:
    for curve, way in ((held.low, -1.0), (held.high, 1.0)):
        rho, alpha1 = curve[0][100:-100:50], curve[1][100:-100:50] + ABREAST_ALPHA1
        assert np.all(held.contains(rho, alpha1, 1e-9))
        assert not np.any(held.contains(rho, alpha1 + way * 1e-3))
    ends = np.array([held.rho_min - 1e-4, held.rho_max + 1e-4])
    assert not np.any(held.contains(ends, np.array([held.high[1][0], held.high[1][-1]]) + ABREAST_ALPHA1))


def test_compiled_and_plain_agree_to_the_last_bit() -> None:
    table = tube_radii(MODEL, ASIDE, 0.11)
    assert table is not None
    arrays = [np.zeros(200_000) for _ in range(4)]
    turn = (0.43, *table, Outline(2.5e-3, 0.02), MODEL)
    count = outermost_turn(arrays[0], arrays[1], *turn)
    assert count == interpreted(outermost_turn)(arrays[2], arrays[3], *turn) > 100
    for compiled, plain in zip(arrays[:2], arrays[2:], strict=True):
        assert compiled[:count].tobytes() == plain[:count].tobytes()
    pieces = (arrays[0][:40].copy(), arrays[1][:40].copy(), 40, *table, MODEL)
    same_bits(worst_across(*pieces), interpreted(worst_across)(*pieces))
