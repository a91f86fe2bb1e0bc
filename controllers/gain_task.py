"""What gains are designed for: a leader, a robot's limits, delays and the errors of estimates."""

from __future__ import annotations

from dataclasses import dataclass

from controllers.limits import Limits
from formation.speed_range import SpeedRange

UNPREDICTED = 0.2
"""Share of the delay that a prediction with estimated motions leaves.

An exact prediction leaves the loop none, as the follower knows its own motion; what is left is an error of
the leader's motion, which high gains follow. So the share depends on leader and robot. Measured with the
prediction that carries on the leader's turn (``benchmarks/gains.py --shares``), where the delay binds: behind
leaders that steer to their k_u in swings of 2 to 4 s, a robot with little speed to spare keeps the distance
better with the gains for this share than for less, by up to 18 %. One with speed to spare, or slower swings,
would bear 0.1 with half to three quarters of the error; but gains are for any steering within k_u.
"""


@dataclass(frozen=True, slots=True)
class Task:
    """What a follower is up to. SI units and radians.

    ``speeds`` and ``k_u`` of the leader. ``delay`` [s] from a capture to the motion that answers it.
    ``sd_v1``, ``sd_alpha1``, ``sd_rho``, ``sd_alpha2``: of the errors of estimates. ``M_alpha2`` [rad/s]:
    bound of the error of alpha2's rate. ``band``: share of rho_0 by which the distance may be off.
    ``unpredicted``: share of the delay that the prediction leaves.
    """

    rho_0: float
    limits: Limits
    speeds: SpeedRange
    k_u: float
    delay: float
    sd_v1: float
    sd_alpha1: float
    sd_rho: float
    sd_alpha2: float
    M_alpha2: float
    band: float = 0.4
    unpredicted: float = UNPREDICTED

    @property
    def left_over(self) -> float:
        """Delay [s] that the prediction leaves."""
        return self.unpredicted * self.delay
