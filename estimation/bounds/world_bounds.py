"""Live bounds in the mocap frame, where v1 and alpha1 rest on positions alone.

There v2 and u2 do not enter v1, alpha1 or h, and one error of the leader's velocity, in any direction and
within W, makes all of theirs. With beta the true alpha1, delta what the believed direction is off, and p, q
the parts of the velocity's error along the true direction and across it, p^2 + q^2 <= W^2 and

* v1 - v1_hat = p - v1_hat (1 - cos(delta)),  sin(delta) = q / v1_hat,
* v1 sin(beta) less what is believed of it = p sin(beta) + q cos(beta),
* cos(beta) - cos(beta_hat) = cos(beta) (1 - cos(delta)) - sin(beta) q / v1_hat,

so that the error of h is p (sin(beta) / rho - f) + q (cos(beta) / rho - mu1 sin(beta) / v1_hat) up to second
order in delta, and at most W times the root of the sum of squares.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.bounds.live_bounds import LawConstants, Moment, MomentBounds, cosine_change, subtended
from estimation.bounds.window_velocity import WindowVelocity
from formation.kernel import kernel
from formation.spacing import restoring


class PositionBounds(NamedTuple):
    """What is known of positions in the mocap frame.

    ``leader``, ``follower``: bounds of the errors of their measured positions, in any direction [m].
    ``acceleration`` [m/s^2] of the leader, and its limit k_v [m/s]. ``longest`` [s]: the best window.
    """

    leader: float
    follower: float
    acceleration: float
    k_v: float
    longest: float


class PositionErrors(NamedTuple):
    """Bounds of the errors of the leader's speed and velocity [m/s], and of the line to it [m]."""

    speed: float
    velocity: float
    line: float


@kernel
def position_errors(seen: Moment, window: WindowVelocity, known: PositionBounds) -> PositionErrors:
    """How wrong speed, velocity and line can be; without a window only the leader's limit is known."""
    if not window.span > 0.0:
        velocity = seen.v1 + known.k_v
        return PositionErrors(velocity, velocity, math.inf)
    A, since = known.acceleration, window.since
    difference = 2.0 * known.leader / window.span + 0.5 * A * window.span
    off = difference + A * since
    line = window.place + known.leader + since * (difference + 0.5 * A * since) + known.follower
    return PositionErrors(abs(window.speed - seen.v1) + off, window.gap + off, line)


@kernel
def world_bounds_at(seen: Moment, errors: PositionErrors, law: LawConstants) -> MomentBounds:
    """Bounds of v1, alpha1 and h of one moment; of h infinite where the line's error reaches rho."""
    wrong, rho, lo = errors.velocity, seen.rho, seen.rho - errors.line
    turned = subtended(wrong, seen.v1, law.v_eps)
    if not lo > 0.0:
        return MomentBounds(errors.speed, math.pi, math.inf)
    tilted = math.asin(errors.line / rho)
    off = seen.alpha1 + law.to_abreast
    f_lo = restoring(lo, law.rho_0, law.mu_rho)
    f_hat = restoring(rho, law.rho_0, law.mu_rho)
    f_hi = restoring(rho + errors.line, law.rho_0, law.mu_rho)
    f = max(abs(f_lo), abs(f_hi))
    change = cosine_change(off, turned)
    apart = wrong / lo + law.mu1 * change + f * errors.speed
    if turned < 0.5 * math.pi and seen.v1 > 0.0:
        along = 1.0 / lo + f
        least = abs(math.cos(seen.alpha1)) + cosine_change(seen.alpha1, turned)
        across = min(least, 1.0) / lo + law.mu1 / seen.v1
        second = (1.0 - math.cos(turned)) * (f * seen.v1 + law.mu1 * min(abs(math.cos(off)) + change, 1.0))
        apart = min(apart, wrong * math.sqrt(along * along + across * across) + second)
    stretch = errors.line / lo
    tilt = 2.0 * math.sin(0.5 * tilted) * ((seen.v1 + wrong) / lo + law.mu1)
    spaced = seen.v1 * (max(f_hat - f_lo, f_hi - f_hat) + stretch * abs(f_hat))
    h = apart + tilt + law.mu1 * stretch * abs(math.cos(off)) + spaced
    return MomentBounds(errors.speed, min(turned + tilted, math.pi), h)
