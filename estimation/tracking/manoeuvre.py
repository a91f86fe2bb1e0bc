"""A leader that changes its motion at once: noticed by innovations that lean to one side for a while.

A filter whose process noise fits a leader most of the time falls behind a step of its speed or turn rate, and
does not say so: its covariance knows nothing of innovations. Those along the leader's direction of motion
tell of its speed, those across it of its turning. Page's cumulative sum (Biometrika 41, 1954) of the
likelihood ratio of a mean of one standard deviation, to either side, tells a run from chance; one outlier
cannot, as none counts for more than three standard deviations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.gaussian import Gaussian, speed_of
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import Measurement
from formation.kernel import kernel

LARGEST_SHARE = 3.0
"""Standard deviations that an innovation counts for at most: two gated outliers in a row are no run."""

ALARM = 9.0
"""Logarithm [nat] of how much likelier a run must be than chance, which brings it in 10,000 innovations."""

LASTS = 0.15
"""How long [s] the noise stays raised after an alarm: about as long as a robot's actuators take."""

REMEMBERED = 20.0
"""Time [s] in which it is forgotten that a leader makes jumps."""

SPEED_RAISED, TURN_RAISED = 0.3, 1.0
"""Bandwidths that the noise is raised to: a step of half of what a leader can do, every second or so."""

SPEED_JUMPY, TURN_JUMPY = 0.1, 0.5
"""Bandwidths of a leader that turns, stops and goes as it likes, and is found to: what its motion comes to on
average has no such tails as its jumps have."""

_SET_OFF = 1.0  # [s]
_SURE = 0.5  # share that one alarm adds to how sure it is that a leader makes jumps

_LEAST_SPEED = 1e-9


class Manoeuvre(NamedTuple):
    """What innovations tell of jumps of the leader's motion.

    ahead, behind, left, right: likelihood ratios [nat] of a run to that side. running: for how long [s] the
    one along has grown. speed_raised, turn_raised: how long [s] noise is to stay raised. speed_jumps,
    turn_jumps: how sure it is, up to 1, that the leader makes jumps; a single alarm may be chance.
    settled_for: for how long [s] the track has been settled: who sets off makes no jump yet.
    """

    ahead: float
    behind: float
    left: float
    right: float
    running: float
    speed_raised: float
    turn_raised: float
    speed_jumps: float
    turn_jumps: float
    settled_for: float


class Noticed(NamedTuple):
    """A manoeuvre with an innovation in it, and the belief that it leaves of what was predicted."""

    manoeuvre: Manoeuvre
    belief: Gaussian


@kernel
def steady() -> Manoeuvre:
    """No sign of any manoeuvre."""
    return Manoeuvre(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def later(manoeuvre: Manoeuvre, dt: float, settled: bool) -> Manoeuvre:
    """The same after dt [s] without news."""
    kept = 1.0 - min(1.0, dt / REMEMBERED)
    return manoeuvre._replace(
        running=manoeuvre.running + dt,
        speed_raised=max(0.0, manoeuvre.speed_raised - dt),
        turn_raised=max(0.0, manoeuvre.turn_raised - dt),
        speed_jumps=manoeuvre.speed_jumps * kept,
        turn_jumps=manoeuvre.turn_jumps * kept,
        settled_for=manoeuvre.settled_for + dt if settled else 0.0,
    )


@kernel
def raised(noise: ProcessNoise, manoeuvre: Manoeuvre, limits: LeaderLimits) -> ProcessNoise:
    """Process noise of a leader that makes jumps, or just now seems to."""
    speed, turn = SPEED_JUMPY * manoeuvre.speed_jumps, TURN_JUMPY * manoeuvre.turn_jumps
    if manoeuvre.speed_raised > 0.0:
        speed = SPEED_RAISED
    if manoeuvre.turn_raised > 0.0:
        turn = TURN_RAISED
    q_v = max(noise.q_v, speed * limits.k_v * limits.k_v)
    return noise._replace(q_v=q_v, q_u=max(noise.q_u, turn * limits.k_u * limits.k_u))


@kernel
def noticed(
    manoeuvre: Manoeuvre,
    prior: Gaussian,
    measurement: Measurement,
    noise: ProcessNoise,
    limits: LeaderLimits,
) -> Noticed:
    """Take in a measurement's innovation; ``prior``: the belief predicted to it, by this process noise.

    At an alarm along the leader's direction the speed's variance grows at once by what raised noise would
    have made of it since the run began. Below half of ``v_eps`` there is no direction to tell a run by.
    """
    speed = speed_of(prior)
    if speed < 0.5 * limits.v_eps:
        return Noticed(manoeuvre._replace(ahead=0.0, behind=0.0, left=0.0, right=0.0), prior)
    ex, ey = prior.vx / max(speed, _LEAST_SPEED), prior.vy / max(speed, _LEAST_SPEED)
    spread = measurement.spread
    xx, xy, yy = prior.x_x + spread.xx, prior.x_y + spread.xy, prior.y_y + spread.yy
    dx, dy = measurement.x - prior.x, measurement.y - prior.y
    along = _share(ex * dx + ey * dy, ex * ex * xx + 2.0 * ex * ey * xy + ey * ey * yy)
    across = _share(ex * dy - ey * dx, ey * ey * xx - 2.0 * ex * ey * xy + ex * ex * yy)
    ahead, behind = _grown(manoeuvre.ahead, along), _grown(manoeuvre.behind, -along)
    left, right = _grown(manoeuvre.left, across), _grown(manoeuvre.right, -across)
    running = manoeuvre.running if ahead > 0.0 or behind > 0.0 else 0.0
    after = manoeuvre._replace(ahead=ahead, behind=behind, left=left, right=right, running=running)
    belief, sure = prior, _SURE if manoeuvre.settled_for >= _SET_OFF else 0.0
    if max(ahead, behind) > ALARM:
        if manoeuvre.speed_raised <= 0.0:
            lacking = max(0.0, SPEED_RAISED * limits.k_v * limits.k_v - noise.q_v) * min(running, LASTS)
            belief = prior._replace(
                vx_vx=prior.vx_vx + ex * ex * lacking,
                vx_vy=prior.vx_vy + ex * ey * lacking,
                vy_vy=prior.vy_vy + ey * ey * lacking,
            )
        jumps = min(1.0, manoeuvre.speed_jumps + sure)
        after = after._replace(ahead=0.0, behind=0.0, running=0.0, speed_raised=LASTS, speed_jumps=jumps)
    if max(left, right) > ALARM:
        jumps = min(1.0, manoeuvre.turn_jumps + sure)
        after = after._replace(left=0.0, right=0.0, turn_raised=LASTS, turn_jumps=jumps)
    return Noticed(after, belief)


@kernel
def _share(innovation: float, variance: float) -> float:
    """Innovation in standard deviations, within what one may count for."""
    return max(-LARGEST_SHARE, min(LARGEST_SHARE, innovation / math.sqrt(variance)))


@kernel
def _grown(ratio: float, share: float) -> float:
    """Likelihood ratio with one more innovation; what speaks against a run begins it anew."""
    return max(0.0, ratio + share - 0.5)
