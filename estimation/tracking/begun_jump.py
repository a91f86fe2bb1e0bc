"""A jump of the leader's motion that may just have begun: what an estimate tells besides its own covariance.

Between a jump and the alarm that it brings some innovations go by, in which the filter is further off than it
knows. What is then known of the leader is a mixture: the belief as it is, or the same after a jump of the
size that an alarm supposes. Its variance is the belief's and, by how likely the jump is (Shiryaev, Theory of
Probability and its Applications 8, 1963), the square of that size. Nothing is carried on from it.
"""

from __future__ import annotations

import math

from estimation.filters.gaussian import Gaussian, speed_of
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.tracking.manoeuvre import (
    BY_CHANCE,
    JUDGED,
    LASTS,
    LEAST_SPEED,
    SET_OFF,
    SPEED_ALARM,
    SPEED_RAISED,
    TURN_ALARM,
    TURN_RAISED,
    Manoeuvre,
    raised,
    with_speed_unsure,
    with_turning_unsure,
)
from formation.kernel import kernel

_RARE = 0.0027  # share of a normal distribution beyond three standard deviations


@kernel
def borne(
    belief: Gaussian, manoeuvre: Manoeuvre, noise: ProcessNoise, limits: LeaderLimits, period: float
) -> Gaussian:
    """Belief for what goes out, of a leader that may just have made a jump: the variance is the mixture's.

    By measurements every ``period`` [s] an alarm is where a jump is as likely as not, if these come as seldom
    as chance brings alarms. Those of the speed come as often besides as they are found to (with half a one
    before the first, as by Jeffreys' prior of a rate).
    """
    along, across = max(manoeuvre.ahead, manoeuvre.behind), max(manoeuvre.left, manoeuvre.right)
    taken = raised(noise, manoeuvre, limits)
    chance = BY_CHANCE * period / max(manoeuvre.watched, SET_OFF)
    speed = _likely(along - SPEED_ALARM, 1.0 + (0.5 + manoeuvre.jumps) * chance)
    turn = _likely(across - TURN_ALARM, 1.0)
    if speed > 0.0 and manoeuvre.speed_raised <= 0.0:
        by = 1.0 / max(speed_of(belief), LEAST_SPEED)
        lacking = speed * max(0.0, SPEED_RAISED * limits.k_v * limits.k_v - taken.q_v)
        belief = with_speed_unsure(
            belief, by * belief.vx, by * belief.vy, lacking, min(manoeuvre.running, LASTS)
        )
    if turn > 0.0 and manoeuvre.turn_raised <= 0.0:
        lacking = turn * max(0.0, TURN_RAISED * limits.k_u * limits.k_u - taken.q_u)
        belief = with_turning_unsure(belief, lacking, min(manoeuvre.turning, JUDGED))
    return belief


@kernel
def _likely(beyond: float, often: float) -> float:
    """Probability of a run, its likelihood ratio being this far [nat] beyond an alarm and it that frequent.

    What is as rare as errors beyond three deviations are anyway counts for nothing: of a calm leader it would
    be most of the variance, and none of the errors.
    """
    odds = often * math.exp(beyond)
    return max(0.0, odds / (1.0 + odds) - _RARE)
