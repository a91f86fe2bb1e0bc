"""A chain of agents in which each follows the one before it by one law, within limits, and without noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers import chain_kernels as kernels
from controllers.laws import Gains
from controllers.limits import Limits
from formation.angles import FloatArray
from formation.closed_loop import IntegrationError
from formation.leader import LeaderProgram, encoded
from formation.pose import Pose
from formation.shape import Shape

RELATIVE_TOLERANCE = 1e-9
ABSOLUTE_TOLERANCE = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class ChainTrajectory:
    """A chain over time, one row per time in ``t`` (n,).

    Pairs, shape (n, N-1), column k for agents k and k+1 (from 0): ``rho``, ``alpha1``, ``alpha2`` (wrapped).
    Agents, shape (n, N): ``wanted``, the speed that the law asked for, ``v`` and ``u``, the motion within the
    limits; ``poses`` of shape (n, N, 3) with columns x, y, theta (wrapped) in the world frame. The first
    agent drives its program, which no limit touches.
    """

    t: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    alpha2: FloatArray
    wanted: FloatArray
    v: FloatArray
    u: FloatArray
    poses: FloatArray


def simulate_chain(
    first: Pose,
    shapes: Sequence[Shape],
    program: LeaderProgram,
    gains: Gains,
    limits: Limits,
    times: FloatArray,
    *,
    knows_turn: bool,
    relative: float = RELATIVE_TOLERANCE,
    absolute: float = ABSOLUTE_TOLERANCE,
) -> ChainTrajectory:
    """Trajectory of the first agent and one follower per shape, at the given increasing times [s].

    Each follower is told the true speed and shape of its predecessor, and with ``knows_turn`` its turn rate:
    law ``ideal``, otherwise ``independent``. Eq. (3) of the paper for every pair by Dormand and Prince's
    5(4) with the given tolerances on (rho, alpha1, alpha2). Raises
    :class:`~formation.closed_loop.IntegrationError` if the motion breaks down, :class:`ValueError` if there
    is no pair, if fewer than two times are given or if the program is of no known kind.
    """
    if not shapes:
        raise ValueError("a chain needs at least one pair")
    if len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise ValueError("a trajectory needs at least two times, in increasing order")
    encoded_program, table = encoded(program)
    start = [number for shape in shapes for number in (shape.rho, shape.alpha1, shape.alpha2)]
    state = np.array([*start, first.x, first.y, first.theta])
    states = np.empty((len(times), len(state)))
    motions = np.empty((len(times), 3, len(shapes) + 1))
    moments = np.ascontiguousarray(times, dtype=np.float64)
    chain = kernels.Chain(gains.settings(limits), encoded_program, knows_turn)
    solver = kernels.Solver(relative, absolute, program.longest_step)
    poses = np.empty((len(times), len(shapes) + 1, 3))
    done = kernels.integrate(moments, solver, state, chain, table, states, motions, poses)
    if not done or not np.all(np.isfinite(states)):
        raise IntegrationError("the motion of the chain breaks down before its end")
    pairs, (wanted, v, u) = states[:, :-3].reshape(len(times), -1, 3), motions.transpose(1, 0, 2)
    return ChainTrajectory(times, pairs[:, :, 0], pairs[:, :, 1], pairs[:, :, 2], wanted, v, u, poses)
