"""Noise-free simulation of a pair under a law: the full shape dynamics, integrated to high accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from formation.angles import FloatArray, wrap
from formation.leader import LeaderProgram
from formation.pose import Motion, Pose
from formation.shape import Shape, follower_pose, shape_of, shape_rates

FollowerLaw = Callable[[Shape, float, float], Motion]
"""What the follower drives, given the true shape (bearings wrapped), v1 and u1."""

RELATIVE_TOLERANCE = 1e-11
ABSOLUTE_TOLERANCE = 1e-12


class IntegrationError(ArithmeticError):
    """The integrator could not go on: the robots met, or the law gave something that is not finite."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A pair over time. All arrays have one row per time in ``t``.

    ``rho``, ``alpha1``, ``alpha2`` (wrapped), the motions ``v1, u1, v2, u2``, each of shape (n,), and the
    poses ``leader`` and ``follower`` of shape (n, 3) with columns x, y, theta (wrapped) in the world frame.
    """

    t: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    alpha2: FloatArray
    v1: FloatArray
    u1: FloatArray
    v2: FloatArray
    u2: FloatArray
    leader: FloatArray
    follower: FloatArray

    def shape_at(self, row: int) -> Shape:
        """Shape in the given row (negative rows count from the end)."""
        return Shape(float(self.rho[row]), float(self.alpha1[row]), float(self.alpha2[row]))


def simulate_pair(
    leader: Pose, follower: Pose, program: LeaderProgram, law: FollowerLaw, times: FloatArray
) -> Trajectory:
    """Trajectory at the given increasing times [s], from the start poses at ``times[0]``.

    Integrates Eq. (3) of the paper and the leader's pose together with DOP853; the follower's pose follows
    from both. The distance is integrated as ln(rho), which cannot step across zero; bearings and heading are
    continuous inside the integration and wrapped in the result. Raises
    :class:`IntegrationError` if the motion does not reach the last time, :class:`ValueError` if the robots
    start in one place or fewer than two times are given.
    """
    if len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise ValueError("a trajectory needs at least two times, in increasing order")
    start = shape_of(leader, follower)
    first = np.array([math.log(start.rho), start.alpha1, start.alpha2, leader.x, leader.y, leader.theta])

    def rates(t: float, state: FloatArray) -> tuple[float, ...]:
        shape, theta = _shape(state), float(state[5])
        driven = program(t)
        shape_dot = shape_rates(shape, driven, law(shape, driven.v, driven.u))
        return (
            shape_dot.rho_dot / shape.rho,
            shape_dot.alpha1_dot,
            shape_dot.alpha2_dot,
            driven.v * math.cos(theta),
            driven.v * math.sin(theta),
            driven.u,
        )

    states = integrate(rates, first, times, program.longest_step)
    return _tabulate(times, states, program, law)


def integrate(
    rates: Callable[[float, FloatArray], tuple[float, ...]],
    first: FloatArray,
    times: FloatArray,
    longest_step: float,
) -> FloatArray:
    """States of shape (n, len(first)) at the n times of an ODE with ``first`` at ``times[0]``.

    Raises :class:`IntegrationError` if the solution cannot be carried to the last time.
    """
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            solution = solve_ivp(
                rates,
                (float(times[0]), float(times[-1])),
                first,
                method="DOP853",
                t_eval=times,
                rtol=RELATIVE_TOLERANCE,
                atol=ABSOLUTE_TOLERANCE,
                max_step=longest_step,
            )
    except (ArithmeticError, ValueError) as error:
        raise IntegrationError(f"the motion breaks down: {error}") from error
    states = np.asarray(solution.y.T, dtype=np.float64)
    if not solution.success or not np.all(np.isfinite(states)):
        reached = float(solution.t[-1]) if len(solution.t) else float(times[0])
        raise IntegrationError(f"the motion breaks down soon after t = {reached:.6g} s: {solution.message}")
    return states


def _shape(state: FloatArray) -> Shape:
    return Shape(math.exp(state[0]), wrap(float(state[1])), wrap(float(state[2])))


def _tabulate(times: FloatArray, states: FloatArray, program: LeaderProgram, law: FollowerLaw) -> Trajectory:
    motions = np.empty((len(times), 4))
    follower = np.empty((len(times), 3))
    for row, (t, state) in enumerate(zip(times, states, strict=True)):
        shape, driven = _shape(state), program(float(t))
        answer = law(shape, driven.v, driven.u)
        motions[row] = driven.v, driven.u, answer.v, answer.u
        pose = follower_pose(shape, Pose(float(state[3]), float(state[4]), float(state[5])))
        follower[row] = pose.x, pose.y, pose.theta
    leader = states[:, 3:6].copy()
    leader[:, 2] = wrap(leader[:, 2])
    return Trajectory(
        t=times,
        rho=np.exp(states[:, 0]),
        alpha1=wrap(states[:, 1]),
        alpha2=wrap(states[:, 2]),
        v1=motions[:, 0],
        u1=motions[:, 1],
        v2=motions[:, 2],
        u2=motions[:, 3],
        leader=leader,
        follower=follower,
    )
