"""Tracks of rigid bodies as a motion capture exports them: their axes, and which of them make a pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.pair_log import Times, known_rows

_TURNED_ENOUGH = 0.02  # mean square of a rotation's vector part: turns of some 15 degrees
_CLEARLY = 4.0


class BodyTrack(NamedTuple):
    """A body's track: ``placements`` (n, 7) position [m] and quaternion x, y, z, w, NaN where it is lost."""

    name: str
    placements: FloatArray


class Export(NamedTuple):
    """What a program exported: the tracks of its bodies at times ``t_ns`` (n,).

    ``up``: the axis that points up where the file or its bodies do not tell. ``facts``: what it was taken
    for, a phrase each. ``details``: what else the file tells of itself. ``damage``: what was left out.
    """

    t_ns: Times
    bodies: list[BodyTrack]
    up: str
    facts: list[str]
    details: dict[str, str]
    damage: tuple[str, ...]


def pair_of(names: Sequence[str], leader: str | None, follower: str | None, source: str) -> tuple[str, str]:
    """Names of leader and follower: those asked for, or what is obvious.

    That is the one that is called so, and of two bodies the first and the second. Raises
    :class:`UsageError`, beginning with ``source``, for a name that isn't there and for a pair that is not
    obvious.
    """
    there = f"there are: {', '.join(map(repr, names)) or 'none'}"
    for option, name in (("--leader", leader), ("--follower", follower)):
        if name is not None and name not in names:
            raise UsageError(f"{source}: {option} {name!r}: no such body; {there}")
    if len(names) < 2:
        raise UsageError(f"{source}: expected a leader and a follower; {there}")
    called = {role: [name for name in names if role in name.lower()] for role in ("lead", "follow")}
    first = leader or (called["lead"][0] if len(called["lead"]) == 1 else None)
    second = follower or (called["follow"][0] if len(called["follow"]) == 1 else None)
    if len(names) == 2:
        if first is None:
            first = next(name for name in names if name != second) if second else names[0]
        if second is None:
            second = next(name for name in names if name != first)
    if first is None or second is None:
        raise UsageError(
            f"{source}: has {len(names)} bodies; name a pair by --leader NAME --follower NAME; {there}"
        )
    if first == second:
        raise UsageError(f"{source}: {first!r} cannot be both leader and follower; {there}")
    return first, second


def found_up(tracks: Sequence[FloatArray], told: str) -> str:
    """The axis that points up, x, y or z: the one that bodies turn about, or along which they do not move.

    ``told`` where they neither turn nor move enough to tell.
    """
    turns, spread = np.zeros(3), np.zeros(3)
    for placements in tracks:
        seen = placements[known_rows(placements)]
        if len(seen) < 2:
            continue
        rotation = Rotation.from_quat(seen[:, 3:])
        turns += np.mean((rotation * rotation[0].inv()).as_quat()[:, :3] ** 2, axis=0)
        spread += np.var(seen[:, :3], axis=0)
    order = np.argsort(turns)
    if turns[order[2]] > _TURNED_ENOUGH and turns[order[2]] > _CLEARLY * turns[order[1]]:
        return "xyz"[order[2]]
    order = np.argsort(spread)
    # Two axes must be driven along, the third not.
    if spread[order[1]] > 1e-3 and spread[order[1]] > _CLEARLY**2 * spread[order[0]]:
        return "xyz"[order[0]]
    return told


def turned_up(placements: FloatArray, up: str) -> FloatArray:
    """Poses (n, 7) with the axis ``up`` turned to z.

    With y up, x stays, z becomes -y, and y becomes z; with x up, y becomes x and z becomes y.
    """
    x, y, z, qx, qy, qz, qw = placements.T
    if up == "y":
        return np.column_stack([x, -z, y, qx, -qz, qy, qw])
    if up == "x":
        return np.column_stack([y, z, x, qy, qz, qx, qw])
    return placements


def at_times(t_ns: Times, placements: FloatArray, moments_ns: Times, most_ns: int) -> FloatArray:
    """Poses (m, 7) at other times, between neighbours at most ``most_ns`` apart; NaN where there are none."""
    after = np.clip(np.searchsorted(t_ns, moments_ns), 1, len(t_ns) - 1)
    before = after - 1
    span = (t_ns[after] - t_ns[before]).astype(np.float64)
    share = (moments_ns - t_ns[before]) / span
    a, b = placements[before], placements[after].copy()
    b[np.einsum("ij,ij->i", a[:, 3:], b[:, 3:]) < 0.0, 3:] *= -1.0
    between = a + share[:, None] * (b - a)
    between[:, 3:] /= np.linalg.norm(between[:, 3:], axis=1, keepdims=True)
    # What was measured at the very time stays as it is.
    between[share == 0.0], between[share == 1.0] = a[share == 0.0], placements[after][share == 1.0]
    apart = (share < 0.0) | (share > 1.0) | ((span > most_ns) & (share != 0.0) & (share != 1.0))
    between[apart] = np.nan
    return between
