"""The compiled chain against the same physics written anew in world coordinates with the laws in Python."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from controllers import chain_kernels
from controllers.chain import ChainTrajectory, simulate_chain
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from formation.angles import FloatArray, wrap
from formation.closed_loop import IntegrationError, simulate_pair
from formation.kernel import interpreted
from formation.leader import Constant, Impulse, LeaderProgram, Sinusoid, Table, encoded
from formation.pose import Motion, Pose
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape, follower_pose, shape_of
from formation.spacing import Spacing
from formation.station import Side, Station

GAINS = Gains(1.0, 2.0, Spacing(0.5, 2.0))
FREE = Limits(1e3, 1e3)
ABREAST_SHAPE = Shape(0.5, ABREAST_ALPHA1, ABREAST_ALPHA2)
IMPULSE = Impulse(0.5, 1.0, 5.0, 1.0)
FIRST = Pose(0.3, -0.5, 0.2)
PROGRAMS = (
    Constant(0.4, 0.1),
    Sinusoid(0.5, 0.1, 0.4, 2.0),
    Impulse(0.5, 1.0, 2.0, 0.7),
    Table((1.0, 2.0, 4.0), (0.3, 0.6, 0.4), (0.0, 0.5, -0.3)),
)


def in_the_world(
    shapes: list[Shape], program: LeaderProgram, law: str, gains: Gains, limits: Limits, times: FloatArray
) -> FloatArray:
    """Poses (n, N, 3), integrated as poses and with the laws as they are called live."""
    poses = [FIRST]
    for shape in shapes:
        poses.append(follower_pose(shape, poses[-1]))

    def rates(t: float, state: FloatArray) -> list[float]:
        agents = [Pose(*row) for row in state.reshape(-1, 3).tolist()]
        motion, change = program(t), []
        for k, agent in enumerate(agents):
            if k:
                shape = shape_of(agents[k - 1], agent)
                motion, _ = limits.apply(LAWS[law](shape, motion.v, motion.u, gains, limits))
            change += [motion.v * math.cos(agent.theta), motion.v * math.sin(agent.theta), motion.u]
        return change

    start = [value for pose in poses for value in (pose.x, pose.y, pose.theta)]
    span = (float(times[0]), float(times[-1]))
    found = solve_ivp(rates, span, start, method="DOP853", t_eval=times, rtol=1e-10, atol=1e-11, max_step=0.1)
    return np.asarray(found.y.T.reshape(len(times), -1, 3), dtype=np.float64)


def chain_of(gains: Gains, duration: float, **changed: Any) -> ChainTrajectory:
    """The paper's chain of five, or what is made of it."""
    given: dict[str, Any] = {
        "program": IMPULSE, "limits": Limits(1.0, 1e3), "agents": 5, "step": 0.05, "law": "ideal", **changed
    }  # fmt: skip
    return simulate_chain(
        FIRST,
        [ABREAST_SHAPE] * (given["agents"] - 1),
        given["program"],
        gains,
        given["limits"],
        np.arange(0.0, duration, given["step"]),
        knows_turn=given["law"] == "ideal",
    )


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: type(program).__name__)
@pytest.mark.parametrize(
    ("law", "gains", "limits"),
    [
        ("ideal", GAINS, Limits(0.42, 2.0)),
        ("independent", Gains(1.0, 2.0, Spacing(0.5, 2.0), tilt=1.2), Limits(0.6, 1.5)),
        ("ideal", Gains(1.0, 2.0, Spacing(0.5, 2.0), Station(Side.LEFT, 1.2), 0.9), Limits(0.7, 2.0)),
    ],
    ids=["paper", "tilt", "left-behind"],
)
def test_the_compiled_chain_is_that_of_the_laws(
    program: LeaderProgram, law: str, gains: Gains, limits: Limits
) -> None:
    station = gains.station
    shapes = [
        Shape(0.7, station.alpha1 + 0.4, station.alpha2 - 0.3),
        Shape(0.6, station.alpha1, station.alpha2),
    ]
    times = np.linspace(0.0, 6.0, 31)
    ours = simulate_chain(FIRST, shapes, program, gains, limits, times, knows_turn=law != "independent")
    known = in_the_world(shapes, program, law, gains, limits, times)
    # Limits make corners, over which the order of the method does not hold.
    np.testing.assert_allclose(ours.poses[:, :, :2], known[:, :, :2], atol=5e-7)
    np.testing.assert_allclose(wrap(ours.poses[:, :, 2] - known[:, :, 2]), 0.0, atol=5e-7)
    assert np.any(np.abs(ours.wanted[:, 1:]) > limits.v_max)
    assert float(np.abs(ours.v[:, 1:]).max()) <= limits.v_max
    for row in (0, 17):
        at = [Pose(*pose) for pose in ours.poses[row].tolist()]
        for k in (1, 2):
            before = Motion(float(ours.v[row, k - 1]), float(ours.u[row, k - 1]))
            asked = LAWS[law](shape_of(at[k - 1], at[k]), before.v, before.u, gains, limits)
            assert (ours.wanted[row, k], ours.u[row, k]) == pytest.approx(
                (asked.v, limits.apply(asked)[0].u), abs=1e-9
            )


@given(st.floats(0.4, 1.0), st.floats(-2.5, -0.7), st.floats(1.0, 2.0), st.sampled_from(sorted(LAWS)))
@settings(max_examples=15)
def test_a_chain_of_two_without_limits_is_the_pair(
    rho: float, alpha1: float, alpha2: float, law: str
) -> None:
    shape, times = Shape(rho, alpha1, alpha2), np.linspace(0.0, 8.0, 9)
    chain = simulate_chain(FIRST, [shape], IMPULSE, GAINS, FREE, times, knows_turn=law != "independent")
    follower = follower_pose(shape, FIRST)
    pair = simulate_pair(FIRST, follower, IMPULSE, lambda s, v, u: LAWS[law](s, v, u, GAINS), times)
    np.testing.assert_allclose(chain.rho[:, 0], pair.rho, rtol=1e-7)
    np.testing.assert_allclose(chain.poses[:, 1, :2], pair.follower[:, :2], atol=1e-6)


def test_samples_between_the_steps_are_as_good_as_at_their_ends() -> None:
    coarse, fine = chain_of(GAINS, 20.0, step=1.0), chain_of(GAINS, 20.0, step=1e-3)
    np.testing.assert_allclose(fine.rho[::1000], coarse.rho, rtol=1e-8)
    np.testing.assert_allclose(fine.rho[500::1000].shape, (20, 4))
    # Rates by central differences of the samples, against the motions that are told beside them.
    speed = np.hypot(*np.gradient(fine.poses[:, :, :2], 1e-3, axis=0)[1:-1].transpose(2, 0, 1))
    np.testing.assert_allclose(speed, np.abs(fine.v[1:-1]), atol=2e-3)


def test_with_the_tilt_all_recover_and_without_it_the_last_does_not() -> None:
    recovered = []
    for tilt in (0.0, 1.2):
        run = chain_of(Gains(1.0, 2.0, GAINS.spacing, tilt=tilt), 40.0)
        recovered.append(np.abs(run.rho[-1] - 0.5) < 1e-3)
    assert recovered[0].tolist() == [True, True, False, False]
    assert recovered[1].tolist() == [True, True, True, True]


@pytest.mark.parametrize("amplitude", [-2.0, -1.0, 2.0])
@pytest.mark.parametrize("law", sorted(LAWS))
def test_a_chain_recovers_from_other_turns_too(amplitude: float, law: str) -> None:
    turn = Impulse(0.5, amplitude, 5.0, 1.0)
    run = chain_of(Gains(1.0, 2.0, GAINS.spacing, tilt=1.2), 60.0, program=turn, law=law)
    np.testing.assert_allclose(run.rho[-1], 0.5, rtol=0.02)
    assert float(run.rho.min()) > 0.2


def test_a_hundred_agents_all_recover() -> None:
    run = chain_of(Gains(1.0, 2.0, GAINS.spacing, tilt=1.4), 500.0, agents=100, step=1.0)
    np.testing.assert_allclose(run.rho[-1], 0.5, rtol=0.02)
    assert float(run.rho.min()) > 0.25


def test_where_nothing_saturates_the_tilt_changes_nothing() -> None:
    gentle = {"program": Impulse(0.5, 0.1, 5.0, 1.0), "limits": Limits(5.0, 1e3)}
    paper = chain_of(GAINS, 20.0, **gentle)
    tilted = chain_of(Gains(1.0, 2.0, GAINS.spacing, tilt=1.2), 20.0, **gentle)
    np.testing.assert_array_equal(paper.poses, tilted.poses)


def test_a_motion_that_breaks_down_says_so() -> None:
    wild = Gains(1.0, 2.0, Spacing(0.5, 1e300))
    with pytest.raises(IntegrationError, match="chain"):
        simulate_chain(
            FIRST, [Shape(1.0, 0.0, 0.0)], IMPULSE, wild, FREE, np.array([0.0, 5.0]), knows_turn=True
        )


def test_what_is_no_chain_is_refused() -> None:
    times = np.array([0.0, 1.0])
    with pytest.raises(ValueError, match="at least one pair"):
        simulate_chain(FIRST, [], IMPULSE, GAINS, FREE, times, knows_turn=True)
    with pytest.raises(ValueError, match="increasing"):
        simulate_chain(FIRST, [ABREAST_SHAPE], IMPULSE, GAINS, FREE, times[::-1], knows_turn=True)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: type(program).__name__)
def test_compiled_and_interpreted_are_the_same(program: LeaderProgram) -> None:
    gains = Gains(1.0, 2.0, Spacing(0.5, 2.0), Station(Side.LEFT, 1.2), 0.9)
    leading, table = encoded(program)
    chain = chain_kernels.Chain(gains.settings(Limits(0.6, 1.5)), leading, True)
    first = np.array([0.7, gains.station.alpha1, 2.0, 0.6, gains.station.alpha1, 1.0, 0.1, 0.2, 0.3])
    times, found = np.linspace(0.0, 0.4, 3), []
    for integrate in (chain_kernels.integrate, interpreted(chain_kernels.integrate)):
        filled = np.empty((3, 9)), np.empty((3, 3, 3)), np.empty((3, 3, 3))
        assert integrate(times, chain_kernels.Solver(1e-6, 1e-7, 0.1), first, chain, table, *filled)
        found.append(b"".join(each.tobytes() for each in filled))
    assert found[0] == found[1]
