"""A flock in which each agent follows a virtual leader, the mean of its nearest neighbours, without noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controllers import flock_kernels as kernels
from controllers.laws import Gains
from controllers.limits import Limits
from formation.angles import FloatArray, wrap
from formation.closed_loop import IntegrationError
from formation.flock_places import may_follow
from formation.leader import LeaderProgram

Indices = NDArray[np.int64]

STEP = 0.01
"""Step [s] of the integration."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Whom an agent follows: the ``neighbours`` nearest ones that it may, chosen anew every ``every_s`` [s].

    In between they are kept, which is the dwell time of the switching. ``least_bearing`` [rad] bounds whom
    an agent may follow, see :func:`formation.flock_places.may_follow`. Raises :class:`ValueError` without a
    neighbour or for a time that is not positive.
    """

    neighbours: int
    every_s: float
    least_bearing: float

    def __post_init__(self) -> None:
        if self.neighbours < 1:
            raise ValueError(f"neighbours is {self.neighbours}, expected at least 1")
        if not (self.every_s > 0.0 and math.isfinite(self.every_s)):
            raise ValueError(f"every_s is {self.every_s}, expected a positive finite number")


@dataclass(frozen=True, slots=True, eq=False)
class FlockTrajectory:
    """A flock over time: one row per time in ``t`` (n,), one column per agent, the leader first.

    ``poses`` (n, N, 3) with columns x, y, theta (wrapped) in the world frame. ``wanted``, the speed that the
    law asked for, ``v`` and ``u``, the motion within the limits, and ``rho``, the distance to the virtual
    leader (0 for the leader), each (n, N). ``neighbours`` (n, N, k): whom each agent follows, nearest at the
    time of choice first, -1 where it may follow fewer. ``clearance`` (n, N): distance to whoever is nearest.
    """

    t: FloatArray
    poses: FloatArray
    wanted: FloatArray
    v: FloatArray
    u: FloatArray
    rho: FloatArray
    neighbours: Indices
    clearance: FloatArray

    def displacements(self, places: FloatArray) -> FloatArray:
        """Where each agent is off its place [m], (n, N, 2): ahead and to the left in the leader's frame."""
        apart = self.poses[:, :, :2] - self.poses[:, :1, :2]
        cos, sin = np.cos(self.poses[:, :1, 2]), np.sin(self.poses[:, :1, 2])
        ahead = cos * apart[:, :, 0] + sin * apart[:, :, 1]
        left = cos * apart[:, :, 1] - sin * apart[:, :, 0]
        return np.stack([ahead, left], axis=2) - places


def simulate_flock(
    first: FloatArray,
    places: FloatArray,
    program: LeaderProgram,
    gains: Gains,
    limits: Limits,
    choice: Choice,
    duration: float,
    *,
    knows_turn: bool,
    step: float = STEP,
    steps_per_sample: int = 10,
) -> FlockTrajectory:
    """Trajectory of a flock from its poses ``first`` (N, 3), the leader's the first of them.

    ``places`` (N, 2) is the formation in the leader's frame. From it an agent's station beside its virtual
    leader follows, whomever it has chosen: distance and bearing of the mean of their places from its own, so
    that the wishes of all agree with each other. ``gains`` gives mu1, mu2, mu_rho and the tilt; its rho_0 and
    station are not looked at. With ``knows_turn`` an agent is told its neighbours' turn rates, law ``ideal``,
    otherwise ``independent``. No limit touches the leader.

    Integrated with the classical Runge-Kutta method. Raises
    :class:`~formation.closed_loop.IntegrationError` if the motion breaks down, :class:`ValueError` if poses
    and places are not as many, if an agent may follow nobody, or if the duration holds no sample.
    """
    if first.shape != (len(places), 3):
        raise ValueError(f"poses have shape {first.shape}, expected ({len(places)}, 3) as there are places")
    allowed = may_follow(places, choice.least_bearing)
    samples = round(duration / (step * steps_per_sample)) + 1
    if samples < 2:
        raise ValueError(f"duration is {duration}, expected at least {step * steps_per_sample:g}")
    agents, steps = len(places), (samples - 1) * steps_per_sample
    motions_of_leader = [program(0.5 * step * k) for k in range(2 * steps + 1)]
    driven = np.array([(motion.v, motion.u) for motion in motions_of_leader])
    poses, motions = np.empty((samples, agents, 3)), np.empty((samples, 4, agents))
    chosen = np.empty((samples, agents, choice.neighbours), dtype=np.int64)
    clearance = np.empty((samples, agents))
    done = kernels.integrate(
        driven,
        kernels.Timing(step, max(1, round(choice.every_s / step)), steps_per_sample),
        np.ascontiguousarray(first, dtype=np.float64),
        np.ascontiguousarray(places, dtype=np.float64),
        allowed,
        kernels.Flock(gains.settings(limits), knows_turn),
        poses,
        motions,
        chosen,
        clearance,
    )
    if not done:
        raise IntegrationError("the motion of the flock breaks down before its end")
    headings: FloatArray = wrap(poses[:, :, 2])
    poses[:, :, 2] = headings
    wanted, v, u, rho = motions.transpose(1, 0, 2)
    t = np.linspace(0.0, steps * step, samples, dtype=np.float64)
    return FlockTrajectory(t, poses, wanted, v, u, rho, chosen, clearance)
