"""The virtual leader of an agent: what it makes of several neighbours to follow them as if they were one."""

from __future__ import annotations

import math
from collections.abc import Sequence

from formation.angles import wrap
from formation.pose import Motion, Pose


def virtual_leader(poses: Sequence[Pose], motions: Sequence[Motion]) -> tuple[Pose, Motion]:
    """Mean position and mean heading of the neighbours, and how that pose moves.

    The heading is the direction of the sum of the unit vectors along the neighbours' headings; the speed is
    the mean velocity's part along it. The turn rate is the exact rate of that heading: the neighbours' turn
    rates weighted with cos(theta_j - theta), so that no accelerations are needed.

    The mean position drifts sideways, too, by the mean of (v_j - v) sin(theta_j - theta): a product of
    differences, zero if the neighbours share one speed or one heading. A unicycle cannot do that, and it is
    left out. One neighbour gives back itself. Raises :class:`ValueError` without neighbours, for a motion too
    few, or if the headings cancel each other.
    """
    x, y = _mean([pose.x for pose in poses]), _mean([pose.y for pose in poses])
    cosine, sine = _mean([math.cos(p.theta) for p in poses]), _mean([math.sin(p.theta) for p in poses])
    if math.hypot(cosine, sine) < 1e-12:
        raise ValueError("the neighbours' headings cancel each other; their mean has no direction")
    theta = wrap(math.atan2(sine, cosine))
    shares = [math.cos(pose.theta - theta) for pose in poses]
    along = [share * motion.v for share, motion in zip(shares, motions, strict=True)]
    turning = [share * motion.u for share, motion in zip(shares, motions, strict=True)]
    return Pose(x, y, theta), Motion(_mean(along), sum(turning) / sum(shares))


def _mean(values: Sequence[float]) -> float:
    if not values:
        raise ValueError("a virtual leader needs at least one neighbour")
    return sum(values) / len(values)
