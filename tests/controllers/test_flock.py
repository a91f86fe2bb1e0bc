"""The compiled flock against laws and virtual leader in Python, the chain, and what its docs claim of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from benchmarks.virtual_leader import virtual_leader
from controllers import flock_kernels as kernels
from controllers.chain import simulate_chain
from controllers.flock import Choice, FlockTrajectory, simulate_flock
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from formation.angles import FloatArray, wrap
from formation.closed_loop import IntegrationError
from formation.flock_places import LEAST_BEARING, may_follow, skein
from formation.kernel import interpreted
from formation.leader import Constant, Impulse, LeaderProgram
from formation.pose import Motion, Pose
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape, shape_of
from formation.spacing import Spacing
from formation.station import Side, Station

MU1, MU2, MU_RHO, SPACING, V1 = 1.0, 2.0, 2.0, 0.5, 0.5
GAINS = Gains(MU1, MU2, Spacing(SPACING, MU_RHO))
LIMITS, FREE = Limits(1.0, 1e3), Limits(1e3, 1e3)
TWO_LAWS = ("ideal", "independent")
CHOICE = Choice(3, 0.5, LEAST_BEARING)
PLACES = skein(109, SPACING)


def scattered(places: FloatArray, seed: int, by: float, turned: float) -> FloatArray:
    off = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(places), 3)) * (by, by, turned)
    off[0] = 0.0
    return np.column_stack([places, np.zeros(len(places))]) + off


def flown(first: FloatArray, duration: float, **changed: Any) -> FlockTrajectory:
    given: dict[str, Any] = {
        "places": PLACES, "program": Constant(V1), "gains": GAINS, "limits": LIMITS, "choice": CHOICE,
        "knows_turn": False, "step": 0.02, "steps_per_sample": 10, **changed,
    }  # fmt: skip
    given["first"], given["duration"] = first, duration
    return simulate_flock(**given)


def off_places(run: FlockTrajectory, places: FloatArray = PLACES) -> FloatArray:
    return np.asarray(np.linalg.norm(run.displacements(places), axis=2))


def station_of(places: FloatArray, agent: int, neighbours: list[int]) -> tuple[float, Station]:
    ahead, left = (places[neighbours].mean(axis=0) - places[agent]).tolist()
    side = Side.RIGHT if left > 0.0 else Side.LEFT
    return math.hypot(ahead, left), Station(side, math.atan2(abs(left), ahead))


@given(st.integers(0, 2**32), st.sampled_from(TWO_LAWS), st.integers(1, 4), st.floats(0.0, 1.3))
@settings(max_examples=30)
def test_the_compiled_flock_is_that_of_the_laws(seed: int, law: str, most: int, tilt: float) -> None:
    places, limits, leader = skein(21, SPACING), Limits(0.6, 2.0), Motion(0.5, 0.3)
    state = scattered(places, seed, 0.3, 1.0)
    chosen = np.empty((21, most), dtype=np.int64)
    kernels.choose(state, may_follow(places), chosen)
    flock = kernels.Flock(Gains(MU1, MU2, GAINS.spacing, tilt=tilt).settings(limits), law == "ideal")
    change, knowledge = np.empty((21, 3)), np.empty((4, 21))
    kernels.rates(leader, state, places, chosen, flock, change, knowledge)
    agents = [Pose(*row) for row in state.tolist()]
    motions = [leader]
    for agent in range(1, 21):
        whom = [int(k) for k in chosen[agent] if k >= 0]
        rho_0, station = station_of(places, agent, whom)
        pose, motion = virtual_leader([agents[k] for k in whom], [motions[k] for k in whom])
        shape = shape_of(pose, agents[agent])
        gains = Gains(MU1, MU2, Spacing(rho_0, MU_RHO), station, tilt)
        wanted = LAWS[law](shape, motion.v, motion.u, gains, limits)
        driven, _ = limits.apply(wanted)
        motions.append(driven)
        known = (wanted.v, driven.v, driven.u, shape.rho)
        np.testing.assert_allclose(knowledge[:, agent], known, rtol=1e-9, atol=1e-10)
    velocities = [
        (m.v * math.cos(a.theta), m.v * math.sin(a.theta), m.u) for a, m in zip(agents, motions, strict=True)
    ]
    np.testing.assert_allclose(change, velocities, atol=1e-9)


@given(st.integers(0, 2**32), st.integers(1, 6))
@settings(max_examples=30)
def test_the_nearest_are_chosen(seed: int, most: int) -> None:
    state, allowed = scattered(PLACES, seed, 0.4, 0.0), may_follow(PLACES)
    chosen = np.empty((len(PLACES), most), dtype=np.int64)
    kernels.choose(state, allowed, chosen)
    for agent in range(1, len(PLACES)):
        whom = np.flatnonzero(allowed[agent])
        distances = np.linalg.norm(state[whom, :2] - state[agent, :2], axis=1)
        nearest = whom[np.argsort(distances)][:most].tolist()
        assert chosen[agent].tolist() == nearest + [-1] * (most - len(nearest))


@pytest.mark.parametrize("law", TWO_LAWS)
def test_in_a_line_abreast_with_one_neighbour_it_is_the_chain(law: str) -> None:
    places = np.array([(0.0, -SPACING * k) for k in range(5)])
    program, first = Impulse(V1, 0.5, 3.0, 1.0), np.column_stack([places, np.zeros(5)])
    gains = Gains(MU1, MU2, GAINS.spacing, tilt=1.2)
    ours = flown(
        first, 12.0, places=places, program=program, gains=gains, choice=Choice(1, 100.0, LEAST_BEARING),
        knows_turn=law == "ideal",
    )  # fmt: skip
    pairs = [Shape(SPACING, ABREAST_ALPHA1, ABREAST_ALPHA2)] * 4
    known = simulate_chain(
        Pose(0.0, 0.0, 0.0), pairs, program, gains, LIMITS, ours.t, knows_turn=law == "ideal"
    )
    np.testing.assert_allclose(ours.poses[:, :, :2], known.poses[:, :, :2], atol=2e-5)
    np.testing.assert_allclose(ours.rho[:, 1:], known.rho, atol=2e-5)
    assert np.any(np.abs(ours.wanted) > LIMITS.v_max)


def test_the_step_is_of_fourth_order() -> None:
    first, places = scattered(skein(21, SPACING), 3, 0.1, 0.3), skein(21, SPACING)
    ends = [
        flown(first, 4.0, places=places, program=Impulse(V1, 0.2, 2.0, 1.0), limits=FREE, step=step,
              steps_per_sample=round(4.0 / step), choice=Choice(3, 100.0, LEAST_BEARING)).poses[-1]
        for step in (0.04, 0.02, 0.0025)
    ]  # fmt: skip
    coarse, fine = (float(np.abs(end - ends[2]).max()) for end in ends[:2])
    assert 10.0 < coarse / fine < 24.0
    assert fine < 1e-6


def jacobian(places: FloatArray, chosen: NDArray[np.int64]) -> FloatArray:
    """Of all followers' rates by their poses, in formation behind a leader that drives straight on."""
    agents, h = len(places), 1e-6
    flock = kernels.Flock(Gains(MU1, MU2, GAINS.spacing).settings(), False)
    found = np.empty((3 * agents - 3, 3 * agents - 3))
    state = np.column_stack([places, np.zeros(agents)])
    for column in range(3 * agents - 3):
        sides = []
        for side in (-h, h):
            moved, change = state.copy(), np.empty((agents, 3))
            moved[1 + column // 3, column % 3] += side
            kernels.rates(Motion(V1, 0.0), moved, places, chosen, flock, change, np.empty((4, agents)))
            sides.append(change[1:].ravel())
        found[:, column] = (sides[1] - sides[0]) / (2.0 * h)
    return found


@pytest.mark.parametrize(("most", "slowest"), [(1, -0.597), (3, -0.276), (6, -0.165)])
def test_the_spectrum_of_the_flock_is_that_of_its_stations(most: int, slowest: float) -> None:
    chosen = np.empty((len(PLACES), most), dtype=np.int64)
    kernels.choose(np.column_stack([PLACES, np.zeros(len(PLACES))]), may_follow(PLACES), chosen)
    matrix, largest = jacobian(PLACES, chosen), -math.inf
    for agent in range(1, len(PLACES)):
        rows = slice(3 * agent - 3, 3 * agent)
        np.testing.assert_allclose(matrix[rows, 3 * agent :], 0.0, atol=1e-9)
        rho_0, station = station_of(PLACES, agent, [int(k) for k in chosen[agent] if k >= 0])
        damping = MU1 + 2.0 * MU_RHO * V1 / math.tan(station.bearing)
        stiffness = 2.0 * MU_RHO * V1**2 / (rho_0 * math.sin(station.bearing))
        expected = np.append(np.roots([1.0, damping, stiffness]), -MU2)
        known = np.poly(np.linalg.eigvals(matrix[rows, rows]))
        np.testing.assert_allclose(known, np.poly(expected), rtol=1e-5)
        largest = max(largest, float(expected.real.max()))
    assert largest == pytest.approx(slowest, abs=5e-4)


@pytest.mark.parametrize("law", TWO_LAWS)
@pytest.mark.parametrize("seed", range(5))
def test_a_scattered_flock_gathers_while_it_switches_neighbours(seed: int, law: str) -> None:
    run = flown(scattered(PLACES, seed, 0.15, 0.5), 40.0, knows_turn=law == "ideal")
    off = off_places(run)
    assert float(off[0].max()) > 0.15
    assert float(off[-1].max()) < 2e-3
    np.testing.assert_allclose(run.poses[-1, :, 2], 0.0, atol=2e-3)
    chosen = np.sort(run.neighbours, axis=2)
    assert np.any(chosen[1:] != chosen[0])
    np.testing.assert_array_equal(chosen[-50:], chosen[-1:].repeat(50, axis=0))


def test_after_a_turn_all_come_back_to_their_places() -> None:
    first = np.column_stack([PLACES, np.zeros(len(PLACES))])
    run = flown(first, 100.0, program=Impulse(V1, 0.1, 25.0, 6.0))
    off = off_places(run)
    assert float(off.max()) > 4.0
    assert float(off[-1].max()) < 1e-3
    assert float(run.clearance.min()) > 0.2
    assert run.poses[-1, 0, 2] == pytest.approx(0.6 * math.sqrt(2.0 * math.pi), rel=1e-3)


def test_the_mean_of_several_does_not_swell_a_turn_where_a_single_neighbour_does() -> None:
    first, peaks = np.column_stack([PLACES, np.zeros(len(PLACES))]), []
    for most in (1, 3):
        turn = Impulse(V1, 1e-3, 25.0, 4.0)
        run = flown(first, 60.0, program=turn, limits=FREE, choice=Choice(most, 0.5, LEAST_BEARING))
        peaks.append(float(np.abs(run.u[:, -20:]).max()) / turn.u_amplitude)
    assert peaks[0] > 1.02
    assert peaks[1] < 0.97


@pytest.mark.parametrize("u", [-0.15, 0.15])
def test_behind_the_beam_of_a_turning_leader_an_agent_rests_where_the_docs_say(u: float) -> None:
    places = np.array([(0.0, 0.0), (-0.25, -SPACING * math.sqrt(0.75))])
    first = np.column_stack([places, np.zeros(2)])
    run = flown(first, 60.0, places=places, program=Constant(V1, u), knows_turn=True)
    leader, agent = (Pose(*row) for row in run.poses[-1].tolist())
    station, rho = Station(Side.RIGHT, math.pi / 3.0), float(run.rho[-1, 1])
    lean = rho * math.cos(station.bearing) * u / V1
    assert math.sin(station.offset(shape_of(leader, agent).alpha1)) == pytest.approx(-lean, abs=1e-6)
    assert GAINS.spacing.f(rho) == pytest.approx(-MU1 * lean / V1, abs=1e-6)


@pytest.mark.parametrize(("share", "holds"), [(0.97, True), (1.03, False)])
def test_a_steady_turn_towards_an_agent_behind_the_beam_is_held_up_to_the_fold(
    share: float, holds: bool
) -> None:
    places = np.array([(0.0, 0.0), (-0.5 * SPACING, -SPACING * math.sqrt(0.75))])
    hardest = 2.0 / (3.0 * math.sqrt(3.0)) * MU_RHO * V1**2 / (MU1 * 0.5 * SPACING)
    first = np.column_stack([places, np.zeros(2)])
    turn = Constant(V1, -share * hardest)
    run = flown(first, 120.0, places=places, program=turn, limits=FREE, knows_turn=True)
    assert (float(run.rho[-1, 1]) < SPACING * math.sqrt(3.0)) is holds


def test_a_mirrored_flock_flies_the_mirrored_way() -> None:
    first = scattered(PLACES, 7, 0.15, 0.5)
    partner = np.array([0, *(k + 1 if k % 2 else k - 1 for k in range(1, len(PLACES)))])
    mirrored = (first * (1.0, -1.0, -1.0))[partner]
    one = flown(first, 10.0, program=Impulse(V1, 0.1, 5.0, 2.0))
    other = flown(mirrored, 10.0, program=Impulse(V1, -0.1, 5.0, 2.0))
    expected = (one.poses * (1.0, -1.0, -1.0))[:, partner]
    np.testing.assert_allclose(other.poses[:, :, :2], expected[:, :, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(other.poses[:, :, 2] - expected[:, :, 2]), 0.0, atol=1e-9)


def test_what_is_no_flock_is_refused() -> None:
    first: FloatArray = np.column_stack([PLACES, np.zeros(len(PLACES))])
    program: LeaderProgram = Constant(V1)
    with pytest.raises(ValueError, match="shape"):
        flown(first[:-1], 1.0, program=program)
    with pytest.raises(ValueError, match="duration"):
        flown(first, 0.01, program=program)
    with pytest.raises(ValueError, match="neighbours is 0"):
        Choice(0, 0.5, LEAST_BEARING)
    with pytest.raises(ValueError, match="every_s"):
        Choice(1, 0.0, LEAST_BEARING)
    met = first.copy()
    met[1] = met[0]
    with pytest.raises(IntegrationError, match="flock"):
        flown(met, 1.0, program=program)


def test_compiled_and_interpreted_are_the_same() -> None:
    places = skein(5, SPACING)
    flock = kernels.Flock(Gains(MU1, MU2, GAINS.spacing, tilt=0.7).settings(Limits(0.55, 2.0)), True)
    driven, timing = np.tile([V1, 0.2], (21, 1)), kernels.Timing(0.02, 3, 5)
    first, found = scattered(places, 3, 0.2, 0.4), []
    for integrate in (kernels.integrate, interpreted(kernels.integrate)):
        poses, motions, near = np.empty((3, 5, 3)), np.empty((3, 4, 5)), np.empty((3, 5))
        chosen = np.empty((3, 5, 2), dtype=np.int64)
        allowed = may_follow(places)
        assert integrate(driven, timing, first, places, allowed, flock, poses, motions, chosen, near)
        found.append(b"".join(each.tobytes() for each in (poses, motions, chosen, near)))
    assert found[0] == found[1]
