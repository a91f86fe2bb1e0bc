"""The filters of a bank: alike but for their process noise, and moved on side by side.

They lie field by field in their rows, so that compiled code works on several at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.ekf import informed, swung_on
from estimation.filters.filter import EKF, Filter
from estimation.filters.gaussian import Gaussian, nis_of
from estimation.filters.lever_arm import is_centred
from estimation.models.coordinated_turn import FollowerMotion, ProcessNoise, Spread
from formation.arc import is_small_swing, small_swing
from formation.kernel import kernel
from formation.records import Rows, load_across, store_across

TURN_MEMBERS, TURN_RATIO, TURN_LOWEST = 7, 4.0, 4.0**-5
"""Members for the turn rate, ratio between them, and the lowest bandwidth: from 0.001 to 4 per second."""

SPEED_MEMBERS, SPEED_RATIO, SPEED_LOWEST = 8, 8.0, 8.0**-7
"""Members for the speed: from 5e-7 to 1 per second."""

MEMBERS = TURN_MEMBERS + SPEED_MEMBERS

LANES = 16
"""Rows that they take, field by field: a multiple of what a processor works on at once."""

_LARGEST_NIS = 400.0  # a member further off starts again from the main filter


class Member(NamedTuple):
    """One filter of the bank: its belief, and the logarithm of its likelihood up to a constant of all.

    prior: logarithm of how likely its noise is by what is told. q_v, q_u: its densities. nis: of its last
    innovation; det: determinant of the covariance of that.
    """

    belief: Gaussian
    score: float
    prior: float
    q_v: float
    q_u: float
    nis: float
    det: float


class Trial(NamedTuple):
    """What a member is tried by: its noise, the time to a measurement, the share of scores kept, and that."""

    noise: ProcessNoise
    dt: float
    kept: float
    x: float
    y: float
    spread: Spread


@kernel(inline=False)
def score_all(
    bank: Rows[Member], trial: Trial, motion: FollowerMotion, belief: Gaussian, estimator: Filter
) -> None:
    """Move all members on to a measurement, score them by that, and let them take it in."""
    together = estimator.in_world and is_centred(estimator.lever)
    for k in range(MEMBERS):
        together = together and is_small_swing(load_across(Member, bank, LANES, k).belief.u, trial.dt)
    if together:
        # Without a branch, so that compiled code works on several members at once.
        for k in range(LANES):
            member = load_across(Member, bank, LANES, k)
            noise = trial.noise._replace(q_v=member.q_v, q_u=member.q_u)
            t = small_swing(member.belief.u, trial.dt)
            prior = swung_on(member.belief, t, trial.dt, noise)
            store_across(bank, LANES, k, _informed(member, prior, trial))
    else:
        for k in range(MEMBERS):
            member = load_across(Member, bank, LANES, k)
            noise = trial.noise._replace(q_v=member.q_v, q_u=member.q_u)
            one = estimator._replace(kind=EKF, noise=noise)
            prior = one.predict(member.belief, trial.dt, motion)
            store_across(bank, LANES, k, _informed(member, prior, trial))
    for k in range(MEMBERS):
        member = load_across(Member, bank, LANES, k)
        score = trial.kept * member.score - 0.5 * (min(member.nis, _LARGEST_NIS) + math.log(member.det))
        store_across(bank, LANES, k, member._replace(score=score))
        if not member.nis <= _LARGEST_NIS:
            store_across(bank, LANES, k, member._replace(score=score, belief=belief))


@kernel
def _informed(member: Member, prior: Gaussian, trial: Trial) -> Member:
    """Member that has taken in a measurement, and what this was to what it has predicted."""
    spread = trial.spread
    a, b, c = prior.x_x + spread.xx, prior.x_y + spread.xy, prior.y_y + spread.yy
    return member._replace(
        belief=informed(prior, trial.x, trial.y, spread),
        nis=nis_of(prior, trial.x, trial.y, spread),
        det=a * c - b * b,
    )
