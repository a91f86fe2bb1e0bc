"""The intersection of all discs that a leader's velocity must lie in, compiled.

Importing this module compiles the kernel for its one signature, or loads it from the cache.
"""

from __future__ import annotations

import math

from formation.kernel import entry
from formation.records import Matrix, Vector

CERTAIN, NOISE, SLOW, ACCELERATION = range(4)
"""What comes out: ranges, or why there are none."""


@entry
def intersect(
    back: Vector, moved: Matrix, blur: Vector, A: float, slowest: float, fastest: float, ranges: Vector
) -> int:
    """Fill ``ranges`` (4,) with the least and the largest speed, and the direction's centre and half width.

    From displacements (n, 2) [m] over the last ``back`` (n,) [s] > 0, n > 0, each known within ``blur`` (n,)
    [m]. Speeds in m/s, angles in rad; the centre is outside of (-pi, pi] by less than a turn, if at all.
    """
    low, farthest, least, best = slowest, math.inf, math.inf, 0
    for i in range(len(back)):
        x, y, by_blur = moved[i, 0] / back[i], moved[i, 1] / back[i], blur[i] / back[i]
        length = math.sqrt(x * x + y * y)
        if length - by_blur > fastest:
            return NOISE
        radius = by_blur + 0.5 * A * back[i]
        low, farthest = max(low, length - radius), min(farthest, length + radius)
        if radius < least:
            least, best = radius, i
    if farthest < slowest:
        return SLOW
    high = min(fastest, farthest)
    if low > high:
        return ACCELERATION
    best_x, best_y = moved[best, 0] / back[best], moved[best, 1] / back[best]
    # Directions are told from that of the best disc, and from the x axis where its centre is the origin.
    ahead_x, ahead_y = (best_x, best_y) if best_x != 0.0 or best_y != 0.0 else (1.0, 0.0)
    left, right = -math.inf, math.inf
    for i in range(len(back)):
        x, y = moved[i, 0] / back[i], moved[i, 1] / back[i]
        radius = blur[i] / back[i] + 0.5 * A * back[i]
        off_x, off_y = x - best_x, y - best_y
        if math.sqrt(off_x * off_x + off_y * off_y) > radius + least:
            return ACCELERATION
        # A disc is seen from the origin under arcsin(radius / length); a known least speed helps as much.
        farther = max(math.sqrt(x * x + y * y), low)
        if radius >= farther:
            continue
        half = math.asin(radius / farther)
        offset = math.atan2(ahead_x * y - ahead_y * x, ahead_x * x + ahead_y * y)
        # Beyond half a turn about the best direction, intervals on the circle could meet twice.
        if abs(offset) + half < math.pi:
            left, right = max(left, offset - half), min(right, offset + half)
    if left > right:
        return ACCELERATION
    ranges[0], ranges[1] = low, high
    direction = math.atan2(ahead_y, ahead_x)
    known = left > -math.inf
    ranges[2] = direction + 0.5 * (left + right) if known else direction
    ranges[3] = 0.5 * (right - left) if known else math.pi
    return CERTAIN
