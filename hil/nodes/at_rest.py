"""When a robot stands, by what it says of its own motion."""

from __future__ import annotations

import math

from formation.pose import Motion
from hil.wire.message_types import Odometry
from hil.wire.messages import MalformedPayloadError, decode_as

STILL_V, STILL_U = 0.01, 0.05
"""Below these [m/s, rad/s] a robot stands: wheels and gyroscopes of one that stands are not quite at zero."""


def stands(own: Motion) -> bool:
    """Whether a robot that moves like this stands.

    >>> stands(Motion(0.002, -0.01)), stands(Motion(0.0, 0.3))
    (True, False)
    """
    return abs(own.v) < STILL_V and abs(own.u) < STILL_U


def own_motion(odometry: bytes) -> Motion | None:
    """How a robot moves by its odometry [m/s, rad/s]; None for what cannot be read, or is not finite."""
    try:
        twist = decode_as(odometry, Odometry).twist.twist
    except MalformedPayloadError:
        return None
    motion = Motion(twist.linear.x, twist.angular.z)
    return motion if all(map(math.isfinite, motion)) else None
