"""The recursion behind the Cramer-Rao bound: the steps of the EKF, taken at the truth."""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.ekf import extended_moved, informed
from estimation.filters.gaussian import Gaussian, started
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, Spread, State
from estimation.models.measurement import PoseNoise, measure_world
from estimation.tracking.estimate import estimate_of
from estimation.tracking.track_point import JumpUncertainty
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Flags, Indices, Matrix, Rows, store

_NS = 1e-9


class Moment(NamedTuple):
    """The truth at one capture; ``wanted``: whether the bound here is asked for."""

    capture_ns: int
    leader: State
    follower: Pose
    v2: float
    u2: float
    measured: bool
    wanted: bool


class Path(NamedTuple):
    """The truth at n captures: x, y, vx, vy, u of the leader, pose and motion of the follower, and flags."""

    capture_ns: Indices
    leader: Matrix
    follower: Matrix
    motion: Matrix
    measured: Flags
    wanted: Flags


class Terms(NamedTuple):
    """What a bound rests on: the leader's limits and noise, that of poses, of v2 [m/s] and u2 [rad/s]."""

    limits: LeaderLimits
    noise: ProcessNoise
    pose: PoseNoise
    sd_v2: float
    sd_u2: float


class Least(NamedTuple):
    """Bound after one capture: of the state, and the least variances of the quantities."""

    known: bool
    state: Gaussian
    rho_dot: float
    alpha2_dot: float
    v1: float
    alpha1: float
    u1: float


@kernel(inline=False)
def carry(path: Path, terms: Terms, bounds: Rows[Least]) -> None:
    """Fill the bound after every moment that is wanted of a path that has some.

    It starts as the filters do, at the first measurement with what the limits say in advance; before it there
    is none.
    """
    variance = terms.pose.position * terms.pose.position
    spread, known = Spread(variance, 0.0, variance), False
    belief = started(0.0, 0.0, spread, terms.limits)
    before, filled = _moment(path, 0), 0
    for k in range(len(path.capture_ns)):
        moment = _moment(path, k)
        if known:
            dt = (moment.capture_ns - before.capture_ns) * _NS
            belief = extended_moved(_at(belief, before.leader), dt, terms.noise)
            if moment.measured:
                belief = informed(belief, belief.x, belief.y, spread)
        elif moment.measured:
            known = True
            belief = started(moment.leader.x, moment.leader.y, spread, terms.limits)
        belief = _at(belief, moment.leader)
        if moment.wanted:
            least = Least(known, belief, math.inf, math.inf, math.inf, math.inf, math.inf)
            store(bounds, filled, _mapped(belief, moment, terms) if known else least)
            filled += 1
        before = moment


@kernel
def _moment(path: Path, k: int) -> Moment:
    leader, pose, motion = path.leader, path.follower, path.motion
    return Moment(
        path.capture_ns[k],
        State(leader[k, 0], leader[k, 1], leader[k, 2], leader[k, 3], leader[k, 4]),
        Pose(pose[k, 0], pose[k, 1], pose[k, 2]),
        motion[k, 0],
        motion[k, 1],
        path.measured[k],
        path.wanted[k],
    )


@kernel
def _at(belief: Gaussian, state: State) -> Gaussian:
    """The same covariance about another state."""
    return belief._replace(x=state.x, y=state.y, vx=state.vx, vy=state.vy, u=state.u)


@kernel
def _mapped(belief: Gaussian, moment: Moment, terms: Terms) -> Least:
    """Bound mapped to the quantities, to first order."""
    motion = FollowerMotion(moment.v2, moment.u2, terms.sd_v2, terms.sd_u2)
    leader = (moment.leader.x, moment.leader.y)
    here = measure_world(moment.capture_ns, leader, moment.follower, terms.pose, motion)
    jump = JumpUncertainty(0.0, 0.0, 0)
    joint = estimate_of(belief, here, 0, math.nan, moment.capture_ns, jump).joint
    return Least(True, belief, joint.r_r, joint.a_a, joint.v_v, joint.b_b, joint.u_u)
