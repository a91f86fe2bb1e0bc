"""The station that a follower keeps beside its leader: the side it drives on, and the bearing it holds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from formation.angles import wrap
from formation.shape import ABREAST_ALPHA2


class Side(Enum):
    """Side of the leader that the follower drives on; the value is the word for scenarios."""

    RIGHT = "right"
    LEFT = "left"

    @property
    def other(self) -> Side:
        """The opposite side."""
        return Side.LEFT if self is Side.RIGHT else Side.RIGHT

    @property
    def sign(self) -> float:
        """+1 on the right, -1 on the left: how kernels know a side."""
        return 1.0 if self is Side.RIGHT else -1.0

    @staticmethod
    def of(sign: float) -> Side:
        """Side of a sign."""
        return Side.RIGHT if sign > 0.0 else Side.LEFT


@dataclass(frozen=True, slots=True)
class Station:
    """Side, and the angle [rad] off the follower's heading at which it keeps the leader, in (0, pi).

    pi/2 is abreast, as in the paper; less puts the follower behind the leader's beam, more ahead of it. Both
    drive on parallel headings there: ``alpha2`` is +bearing for a follower on the right and -bearing for one
    on the left, and ``alpha1 = alpha2 - pi``, wrapped. Raises :class:`ValueError` for a bearing outside
    (0, pi): in line ahead the follower's speed cannot act on alpha1.

    ``sign``: +1 on the right, -1 on the left. ``cos``, ``sin``: of ``alpha2``, the sine with the side's sign;
    the cosine is exactly zero abreast, so that no rounding enters the paper's laws.
    """

    side: Side = Side.RIGHT
    bearing: float = ABREAST_ALPHA2
    sign: float = field(init=False, repr=False, compare=False)
    cos: float = field(init=False, repr=False, compare=False)
    sin: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.bearing < math.pi:
            raise ValueError(f"bearing is {self.bearing}, expected an angle between 0 and pi")
        sign = self.side.sign
        cos = 0.0 if self.bearing == ABREAST_ALPHA2 else math.cos(self.bearing)
        for name, value in (("sign", sign), ("cos", cos), ("sin", sign * math.sin(self.bearing))):
            object.__setattr__(self, name, value)

    @property
    def alpha2(self) -> float:
        """Desired bearing [rad] of the leader from the follower."""
        return self.sign * self.bearing

    @property
    def alpha1(self) -> float:
        """Desired bearing [rad] of the follower from the leader."""
        return wrap(self.alpha2 - math.pi)

    @property
    def to_abreast(self) -> float:
        """Angle [rad] that turns alpha1 at this station into -pi/2; exactly 0 abreast on the right.

        cos(alpha1 + to_abreast) is the sine of the angle by which alpha1 is off the station.
        """
        return ABREAST_ALPHA2 - self.alpha2

    def offset(self, alpha1: float) -> float:
        """Angle [rad] by which alpha1 is off its desired value, wrapped."""
        return wrap(alpha1 - self.alpha1)


ABREAST = Station()
"""Abreast on the right, the paper's convention."""
