"""Places of a flock about its leader, and whom each agent may follow from its place.

A place is (x, y) [m] in the leader's frame: x ahead, y to the left. The leader's own is the first, (0, 0).
The wing on the right (y < 0) follows on the right, the other is its mirror image.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray

LEAST_BEARING = math.pi / 7.0
"""Nearer to straight ahead than this [rad] nobody is followed: the law divides by the sine of the bearing."""

_ROUNDING = 1e-9


def skein(agents: int, spacing: float) -> FloatArray:
    """Places (agents, 2) of an arrowhead on a lattice of equilateral triangles with sides ``spacing`` [m].

    File c of a wing lies 0.866 c sides beside the leader and holds c + 1 places, one behind the other, the
    first half a side further back than that of the file before; files fill from the leader outwards, each
    from its front, right and left in turn. The leader is seen between 30 and 60 degrees off the heading.
    Raises :class:`ValueError` without a follower.
    """
    if agents < 2:
        raise ValueError(f"a flock of {agents} has no follower, expected at least 2 agents")
    places = [(0.0, 0.0)]
    file = 1
    while len(places) < agents:
        for rank in range(file + 1):
            x, y = -spacing * (0.5 * file + rank), spacing * file * math.sqrt(0.75)
            places += [(x, -y), (x, y)]
        file += 1
    return np.array(places[:agents])


def may_follow(places: FloatArray, least_bearing: float = LEAST_BEARING) -> NDArray[np.bool_]:
    """Table (N, N): whether the agent of a row may follow that of a column.

    It may follow those of its own wing, and the leader, that are nearer than itself to the leader's line of
    travel and whose places it sees at a bearing between ``least_bearing`` and pi/2, abeam. Nobody is then
    followed by one whom he follows, however many steps lie between; and as these directions make a cone, the
    mean of several lies in it like each of them. Raises :class:`ValueError` if an agent may follow nobody,
    or one that comes after it.
    """
    ahead = places[np.newaxis, :, 0] - places[:, np.newaxis, 0]
    aside = np.abs(places[:, 1])[:, np.newaxis] - np.abs(places[:, 1])[np.newaxis, :]
    wing = np.sign(np.where(np.abs(places[:, 1]) < _ROUNDING, 0.0, places[:, 1]))
    same_wing = (wing[:, np.newaxis] == wing[np.newaxis, :]) | (wing[np.newaxis, :] == 0.0)
    bearing = np.arctan2(aside, ahead)
    in_cone = (bearing >= least_bearing - _ROUNDING) & (bearing <= 0.5 * math.pi + _ROUNDING)
    allowed = np.asarray(same_wing & in_cone & (aside > _ROUNDING))
    lost = np.flatnonzero(~allowed[1:].any(axis=1)) + 1
    if len(lost):
        x, y = places[lost[0]].tolist()
        raise ValueError(f"agent {lost[0] + 1} at ({x:g}, {y:g}) sees nobody whom it may follow")
    if np.any(np.triu(allowed)):
        raise ValueError("places out of order: each has to come after those that it may follow")
    return allowed
