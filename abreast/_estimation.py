"""From the tracks of a pair to estimates of its leader."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from abreast._estimates import Estimates, estimates_of
from abreast._scenarios import Own, ScenarioLike, scenario_of, text_of
from formation.angles import FloatArray
from hil.errors import UsageError
from hil.replay.pose_tracks import PoseTracks, estimates_of_tracks
from hil.scenario.links import refuse_chain

_NS = 1e9
_LATEST_S = 2.0**31
_SURELY = 0.9  # of how well headings point along a track
_LEAST_WAY = 1e-9


def estimate(
    t: ArrayLike,
    leader: ArrayLike,
    follower: ArrayLike,
    *,
    scenario: ScenarioLike = "turtlebot3",
    estimator: Own = "ekf",
    own_motion: str = "auto",
    v2: ArrayLike | None = None,
    u2: ArrayLike | None = None,
) -> Estimates:
    """Estimate the leader's speed and heading along the measured tracks of a pair.

    Each row is one motion-capture frame, taken through the very steps that run live.

    ``t`` (n,): times [s] that increase, from any zero. ``leader`` (n, 2): its x, y [m]. ``follower`` (n, 3):
    its x, y [m] and heading [rad] in the same frame. A row of either with a NaN counts as not seen.
    ``v2``, ``u2`` (n,): the follower's measured speed [m/s] and turn rate [rad/s] at the same times; without
    them its own track tells its motion. ``scenario``: whose noise and limits of the leader the
    estimator goes by (``estimator.sigma_position``, ``leader.k_v`` ...). ``estimator``: ``ekf``, ``ukf``,
    ``imm`` ... ``smoother``, which looks at all rows for each, or your own. ``own_motion``: ``odometry``
    (v2, u2), ``mocap`` (its track), ``fused`` (both), or ``auto``: odometry while its track bears that out.

    Returns :class:`Estimates` with n rows. Raises :class:`UsageError`, one line, for arrays that do not fit
    together, times that do not increase, headings in degrees, and if no row gives an estimate.

    >>> import abreast, numpy as np
    >>> t = np.arange(0.0, 3.0, 1.0 / 120.0)
    >>> heading = 0.5 * t
    >>> leader = 0.2 * np.column_stack([np.sin(heading), 1.0 - np.cos(heading)])
    >>> outside = 0.25 * np.column_stack([np.sin(heading), -np.cos(heading)])
    >>> follower = np.column_stack([leader + outside, heading])
    >>> found = abreast.estimate(t, leader, follower)
    >>> print(f"{found.v1[-1]:.3f} m/s, {found.u1[-1]:.1f} rad/s, {found.status[-1]}")
    0.100 m/s, 0.5 rad/s, tracking
    """
    times = _times(t)
    n = len(times)
    tracks = PoseTracks(
        _whole_ns(times),
        _rows(leader, "leader", (n, 2), "x, y of its positions"),
        _rows(follower, "follower", (n, 3), "x, y and heading"),
        _motion(v2, u2, n),
    )
    _refuse_degrees(tracks.follower)
    chosen = scenario_of(
        scenario,
        {
            "estimator.kind": text_of(estimator),
            "estimator.own_motion": _source(own_motion, tracks.motion),
            # Rows have one time only: when they came nobody knows.
            "estimator.clock": "trusted",
        },
    )
    refuse_chain(chosen, "give the scenario of a pair")
    _refuse_sparse(times, chosen.estimator.lost_after_s)
    found = estimates_of_tracks(tracks, chosen)
    if all(each is None for each in found.estimates):
        causes = ", ".join(f"{cause} {count}" for cause, count in found.refused.items())
        raise UsageError(f"no row of {n} gives an estimate (refused: {causes or 'none, as no row is whole'})")
    return estimates_of(times, found.estimates, found.reasons)


def _source(own_motion: str, motion: FloatArray | None) -> str:
    if motion is None and own_motion not in ("auto", "mocap"):
        raise UsageError(
            f"own_motion is {own_motion!r}, but there are no v2 and u2; give both, or leave own_motion out"
        )
    return own_motion


def _array(given: ArrayLike, name: str) -> FloatArray:
    try:
        if np.iscomplexobj(given):
            raise UsageError(f"{name} is complex, expected real numbers")
        if np.ma.isMaskedArray(given):
            return np.array(np.ma.filled(given.astype(np.float64), math.nan))
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} is no array of numbers ({error})") from None


def _times(t: ArrayLike) -> FloatArray:
    times = _array(t, "t")
    if times.ndim != 1 or len(times) == 0:
        raise UsageError(f"t has shape {times.shape}, expected (n,): one time for each row")
    if not np.all(np.isfinite(times)):
        row = int(np.flatnonzero(~np.isfinite(times))[0])
        raise UsageError(f"t[{row}] is {times[row]}, expected a finite number of seconds")
    steps = np.diff(times)
    if np.any(steps <= 0.0):
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise UsageError(
            f"t[{row}] is {times[row]:.9g} after {times[row - 1]:.9g}: expected times that increase; sort "
            "the rows by time, one for each"
        )
    if times[-1] - min(times[0], 0.0) >= _LATEST_S:
        raise UsageError(
            f"t[{len(times) - 1}] is {times[-1]:.9g}, expected seconds; are these milli- or nanoseconds?"
        )
    return times


def _whole_ns(times: FloatArray) -> NDArray[np.int64]:
    """Times as stamps, which count from zero: by whole seconds later where some are negative."""
    shifted = times + math.ceil(max(0.0, -times[0]))
    stamps: NDArray[np.int64] = np.rint(shifted * _NS).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        row = int(np.flatnonzero(np.diff(stamps) <= 0)[0]) + 1
        raise UsageError(f"t[{row}] is less than a nanosecond after t[{row - 1}]; leave one of the rows out")
    return stamps


def _refuse_sparse(times: FloatArray, lost_after: float) -> None:
    """Rows that are so far apart that each would start anew."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if step > lost_after:
        raise UsageError(
            f"t: rows are {step:.4g} s apart (median), expected less than estimator.lost_after_s = "
            f"{lost_after:g} s; are these milliseconds?"
        )


def _rows(given: ArrayLike, name: str, shape: tuple[int, ...], what: str) -> FloatArray:
    rows = _array(given, name)
    if rows.shape != shape:
        raise UsageError(f"{name} has shape {rows.shape}, expected {shape}: {what}, a row for each time")
    if np.any(np.isinf(rows)):
        row = int(np.flatnonzero(np.isinf(rows).reshape(len(rows), -1).any(axis=1))[0])
        raise UsageError(f"{name}[{row}] is infinite; put nan where it was not seen")
    return rows


def _motion(v2: ArrayLike | None, u2: ArrayLike | None, n: int) -> FloatArray | None:
    if v2 is None and u2 is None:
        return None
    if v2 is None or u2 is None:
        missing, given = ("v2", "u2") if v2 is None else ("u2", "v2")
        raise UsageError(f"{given} is given without {missing}; give both, or neither")
    speed, turn = (_rows(each, name, (n,), "one") for each, name in ((v2, "v2"), (u2, "u2")))
    return np.column_stack([speed, turn])


def _refuse_degrees(follower: FloatArray) -> None:
    """Headings may have turned round many times; those in degrees point along the track as such only."""
    seen = follower[np.isfinite(follower).all(axis=1)]
    if len(seen) < 2 or np.max(np.abs(seen[:, 2])) <= 2.0 * math.pi:
        return
    ways = np.diff(seen[:, :2], axis=0)
    length = float(np.sum(np.hypot(*ways.T)))
    if length < _LEAST_WAY:
        return
    along = {
        unit: abs(float(np.sum(ways * np.column_stack([np.cos(theta), np.sin(theta)])))) / length
        for unit, theta in (("rad", seen[:-1, 2]), ("deg", np.radians(seen[:-1, 2])))
    }
    if along["deg"] > max(_SURELY, along["rad"]):
        raise UsageError(
            f"follower[:, 2] goes up to {np.max(np.abs(seen[:, 2])):.4g} and points along the track if taken "
            "for degrees; expected headings in radians: give np.radians of them"
        )
