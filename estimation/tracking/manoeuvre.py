"""A leader that changes its motion at once: noticed by innovations that lean to one side for a while.

A filter whose process noise fits a leader most of the time falls behind a step of its speed or turn rate, and
does not say so: its covariance knows nothing of innovations. Those along the leader's direction of motion
tell of its speed, those across it of its turning. Page's cumulative sum (Biometrika 41, 1954) of the
likelihood ratio of a mean that is not zero, to either side, tells a run from chance; one outlier cannot, as
none counts for more than three standard deviations. A step of the speed shows by a mean of a standard
deviation or more for a few innovations. One of the turn rate has to become one of the direction first, so
that innovations lean by half of that, and for longer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.gaussian import Gaussian, speed_of, variance_along
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import Measurement
from formation.kernel import kernel

LARGEST_SHARE = 3.0
"""Standard deviations that an innovation counts for at most: two gated outliers in a row are no run."""

SPEED_LEAN, TURN_LEAN = 1.0, 0.5
"""Means [standard deviations] that runs along and across are looked for by."""

SPEED_ALARM, TURN_ALARM, BY_CHANCE = 9.0, 7.6, 8000.0
"""Logarithms [nat] of how much likelier such a run must be than chance, and innovations in which that brings
either: by a mean m a sum takes 2 (exp(h) - h - 1) / m^2 of them to reach h (Siegmund 1985)."""

LASTS = 0.15
"""How long [s] the noise stays raised after an alarm: about as long as a robot's actuators take."""

JUDGED = 0.3
"""How long [s] after an alarm the speed may show to be another one; for half of it noise is as before."""

REMEMBERED = 20.0
"""Time [s] in which it is forgotten that a leader makes jumps."""

SPEED_RAISED, TURN_RAISED = 0.3, 1.0
"""Bandwidths that the noise is raised to: a step of half of what a leader can do, every second or so."""

TURN_JUMPY = 0.5
"""Bandwidth of a leader that turns as it likes, and is found to: what its turning comes to on average has no
such tails as its jumps have."""

SET_OFF = 1.0
"""Time [s] of a settled track in which no alarm counts as a jump."""

LEAST_SPEED = 1e-9
"""Speed [m/s] that one below it is taken for where a direction is to be told by it."""

# Share that one alarm adds to how sure it is that a leader makes jumps of its turn rate: these come every few
# seconds, an alarm by chance once a minute, and one leader in five or so is of that kind.
_SURE = 0.8
_APART = 3.0  # standard deviations between a speed before and after an alarm by which it was no chance


class Manoeuvre(NamedTuple):
    """What innovations tell of jumps of the leader's motion.

    ahead, behind, left, right: likelihood ratios [nat] of a run to that side. running, turning: for how long
    [s] the one along and the one across have grown. speed_was, speed_variance: speed [m/s] before the one
    along, and its variance. unjudged: how long [s] it is still to be compared with the speed after an alarm;
    jump: the largest square [m^2/s^2] that it was off by since. speed_raised, turn_raised: how long [s] noise
    is to stay raised. jumps, speed_jumps: number of jumps of the speed and sum of their squares [m^2/s^2];
    watched: time [s] of a settled track that they were found in; all of them are forgotten. turn_jumps: how
    sure it is, up to 1, that the leader makes jumps of its turn rate. settled_for: for how long [s] the track
    has been settled: who sets off makes no jump yet.
    """

    ahead: float
    behind: float
    left: float
    right: float
    running: float
    turning: float
    speed_was: float
    speed_variance: float
    unjudged: float
    jump: float
    speed_raised: float
    turn_raised: float
    jumps: float
    speed_jumps: float
    watched: float
    turn_jumps: float
    settled_for: float


class Noticed(NamedTuple):
    """A manoeuvre with an innovation in it, and the belief that it leaves of what was predicted."""

    manoeuvre: Manoeuvre
    belief: Gaussian


@kernel
def steady() -> Manoeuvre:
    """No sign of any manoeuvre."""
    return Manoeuvre(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def later(manoeuvre: Manoeuvre, dt: float, settled: bool) -> Manoeuvre:
    """The same after dt [s] without news."""
    kept = 1.0 - min(1.0, dt / REMEMBERED)
    return manoeuvre._replace(
        running=manoeuvre.running + dt,
        turning=manoeuvre.turning + dt,
        unjudged=max(0.0, manoeuvre.unjudged - dt),
        speed_raised=max(0.0, manoeuvre.speed_raised - dt),
        turn_raised=max(0.0, manoeuvre.turn_raised - dt),
        jumps=manoeuvre.jumps * kept,
        speed_jumps=manoeuvre.speed_jumps * kept,
        watched=manoeuvre.watched * kept + (dt if settled else 0.0),
        turn_jumps=manoeuvre.turn_jumps * kept,
        settled_for=manoeuvre.settled_for + dt if settled else 0.0,
    )


@kernel
def raised(noise: ProcessNoise, manoeuvre: Manoeuvre, limits: LeaderLimits) -> ProcessNoise:
    """Process noise of a leader that makes jumps, or just now seems to."""
    highest, turn = SPEED_RAISED * limits.k_v * limits.k_v, TURN_JUMPY * manoeuvre.turn_jumps
    speed = min(highest, manoeuvre.speed_jumps / max(manoeuvre.watched, SET_OFF))
    if manoeuvre.speed_raised > 0.0:
        speed = highest
    if manoeuvre.turn_raised > 0.0:
        turn = TURN_RAISED
    return noise._replace(q_v=max(noise.q_v, speed), q_u=max(noise.q_u, turn * limits.k_u * limits.k_u))


@kernel
def noticed(
    manoeuvre: Manoeuvre,
    prior: Gaussian,
    measurement: Measurement,
    noise: ProcessNoise,
    limits: LeaderLimits,
) -> Noticed:
    """Take in a measurement's innovation; ``prior``: the belief predicted to it, by this process noise.

    At an alarm the speed's variance, or that of turn rate and direction, grows at once by what raised noise
    would have made of it since the run began. Below half of ``v_eps`` there is no direction to tell a run by.
    """
    speed = speed_of(prior)
    ex, ey = prior.vx / max(speed, LEAST_SPEED), prior.vy / max(speed, LEAST_SPEED)
    variance = variance_along(prior, ex, ey)
    manoeuvre = _judged(manoeuvre, speed, variance)
    if speed < 0.5 * limits.v_eps:
        return Noticed(manoeuvre._replace(ahead=0.0, behind=0.0, left=0.0, right=0.0), prior)
    spread = measurement.spread
    xx, xy, yy = prior.x_x + spread.xx, prior.x_y + spread.xy, prior.y_y + spread.yy
    dx, dy = measurement.x - prior.x, measurement.y - prior.y
    along = _share(ex * dx + ey * dy, ex * ex * xx + 2.0 * ex * ey * xy + ey * ey * yy)
    across = _share(ex * dy - ey * dx, ey * ey * xx - 2.0 * ex * ey * xy + ex * ex * yy)
    ahead = _grown(manoeuvre.ahead, along, SPEED_LEAN)
    behind = _grown(manoeuvre.behind, -along, SPEED_LEAN)
    left = _grown(manoeuvre.left, across, TURN_LEAN)
    right = _grown(manoeuvre.right, -across, TURN_LEAN)
    running = manoeuvre.running if ahead > 0.0 or behind > 0.0 else 0.0
    turning = manoeuvre.turning if left > 0.0 or right > 0.0 else 0.0
    after = manoeuvre._replace(
        ahead=ahead, behind=behind, left=left, right=right, running=running, turning=turning
    )
    if running == 0.0 and manoeuvre.unjudged <= 0.0:
        after = after._replace(speed_was=speed, speed_variance=variance)
    belief, settled = prior, manoeuvre.settled_for >= SET_OFF
    if max(ahead, behind) > SPEED_ALARM:
        if manoeuvre.speed_raised <= 0.0:
            lacking = max(0.0, SPEED_RAISED * limits.k_v * limits.k_v - noise.q_v)
            belief = with_speed_unsure(belief, ex, ey, lacking, min(running, LASTS))
        jump = manoeuvre.jump if manoeuvre.unjudged > 0.0 else 0.0
        unjudged = JUDGED if settled else manoeuvre.unjudged
        after = after._replace(
            ahead=0.0, behind=0.0, running=0.0, speed_raised=LASTS, unjudged=unjudged, jump=jump
        )
    if max(left, right) > TURN_ALARM:
        if manoeuvre.turn_raised <= 0.0:
            lacking = max(0.0, TURN_RAISED * limits.k_u * limits.k_u - noise.q_u)
            belief = with_turning_unsure(belief, lacking, min(turning, LASTS))
        jumps = min(1.0, manoeuvre.turn_jumps + (_SURE if settled else 0.0))
        after = after._replace(left=0.0, right=0.0, turning=0.0, turn_raised=LASTS, turn_jumps=jumps)
    return Noticed(after, belief)


@kernel
def _judged(manoeuvre: Manoeuvre, speed: float, variance: float) -> Manoeuvre:
    """The same, an alarm of the speed counting as a jump once the speed surely is another one than before.

    By chance innovations may lean to one side for a while, but the speed is the same one afterwards. The jump
    is the largest that it is off by, less what errors come to.
    """
    apart, errors = speed - manoeuvre.speed_was, variance + manoeuvre.speed_variance
    jump = apart * apart - errors
    differs = apart * apart > _APART * _APART * errors
    if manoeuvre.unjudged <= 0.0 or not differs or jump <= manoeuvre.jump:
        return manoeuvre
    another = 1.0 if manoeuvre.jump == 0.0 else 0.0
    return manoeuvre._replace(
        jump=jump,
        jumps=manoeuvre.jumps + another,
        speed_jumps=manoeuvre.speed_jumps + jump - manoeuvre.jump,
    )


@kernel
def with_speed_unsure(belief: Gaussian, ex: float, ey: float, q_v: float, dt: float) -> Gaussian:
    """Belief whose speed, in its direction (ex, ey), was driven by more noise for dt [s]."""
    lacking = q_v * dt
    return belief._replace(
        vx_vx=belief.vx_vx + ex * ex * lacking,
        vx_vy=belief.vx_vy + ex * ey * lacking,
        vy_vy=belief.vy_vy + ey * ey * lacking,
    )


@kernel
def with_turning_unsure(belief: Gaussian, q_u: float, dt: float) -> Gaussian:
    """Belief whose turn rate was driven by more noise for dt [s], and its direction by the turn rate."""
    vx, vy = belief.vx, belief.vy
    turn, both, direction = q_u * dt, q_u * dt * dt / 2.0, q_u * dt * dt * dt / 3.0
    return belief._replace(
        vx_vx=belief.vx_vx + vy * vy * direction,
        vx_vy=belief.vx_vy - vx * vy * direction,
        vx_u=belief.vx_u - vy * both,
        vy_vy=belief.vy_vy + vx * vx * direction,
        vy_u=belief.vy_u + vx * both,
        u_u=belief.u_u + turn,
    )


@kernel
def _share(innovation: float, variance: float) -> float:
    """Innovation in standard deviations, within what one may count for."""
    return max(-LARGEST_SHARE, min(LARGEST_SHARE, innovation / math.sqrt(variance)))


@kernel
def _grown(ratio: float, share: float, lean: float) -> float:
    """Likelihood ratio of a mean with one more innovation; what speaks against a run begins it anew."""
    return max(0.0, ratio + lean * (share - 0.5 * lean))
