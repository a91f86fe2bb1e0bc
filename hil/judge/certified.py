"""The certified radius around every estimate of a log: what noise and leader limits alone guarantee."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from estimation.certified import certain_alpha1, certain_motion
from estimation.guarantees import guaranteed_window
from formation.angles import FloatArray, wrap
from hil.certificate import premises_of
from hil.errors import UsageError
from hil.judge.columns import columns_of
from hil.judge.evidence import Evidence
from hil.log.reader import Log
from hil.wire import topics
from hil.wire.intake import RefusedError, read_frame
from hil.wire.topics import topics_of

_LONGEST_WINDOW = 1.5
_Fix = tuple[float, float, float, float]


def judge_certified(log: Log, evidence: Evidence) -> dict[str, Any]:
    """The ``certified`` part of a summary of estimates in the world frame.

    Per quantity v1 [m/s] and alpha1 [rad] the median and the largest certified radius of the judged
    estimates; where the truth is known, how many errors exceed it (none may) and the largest error / radius.
    ``certified``: estimates that have a radius; ``contradicted``: those whose positions contradict the bounds
    that were assumed. Raises :class:`UsageError` for the body front end, which has no positions.
    """
    scenario = evidence.scenario
    if scenario.estimator.front_end != "world":
        raise UsageError('--certify needs positions of the leader: estimator.front_end = "world"')
    fixes = _fixes(log, evidence)
    stamps = np.array(sorted(fixes), dtype=np.int64)
    positions = np.array([fixes[at] for at in stamps.tolist()], dtype=np.float64).reshape(-1, 4)
    given, columns = premises_of(scenario), columns_of(evidence)
    window_ns = round(_LONGEST_WINDOW * 1e9 * float(guaranteed_window(given.eps, given.acceleration)))
    samples, seen = columns.samples, columns.samples.seen
    radii = np.full((len(samples.capture_ns), 2), math.nan)
    contradicted = 0
    for row, at in enumerate(samples.capture_ns.tolist()):
        end = int(np.searchsorted(stamps, at, side="right"))
        if not end or stamps[end - 1] != at:
            continue
        begin = int(np.searchsorted(stamps, at - window_ns))
        times, xy = (stamps[begin:end] - at) * 1e-9, positions[begin:end]
        motion = certain_motion(times, xy[:, :2], given.eps, given.acceleration, (given.v_eps, given.k_v))
        if motion is None:
            contradicted += int(end - begin > 1)
            continue
        bearing = certain_alpha1(motion, xy[-1, :2], xy[-1, 2:], given.eps)
        radii[row, 0] = motion.speed.radius(float(np.asarray(seen.v1)[row]))
        radii[row, 1] = bearing.radius(float(np.asarray(seen.alpha1)[row]), on_circle=True)
    errors = {"v1": seen.v1 - columns.true.v1, "alpha1": wrap(np.asarray(seen.alpha1 - columns.true.alpha1))}
    found: dict[str, Any] = {
        name: _verdict(radii[:, column], np.abs(errors[name])) for column, name in enumerate(errors)
    }
    return {"certified": int(np.isfinite(radii[:, 0]).sum()), "contradicted": contradicted} | found


def _verdict(radius: FloatArray, error: FloatArray) -> Mapping[str, float]:
    has = np.isfinite(radius)
    if not np.any(has):
        return {}
    told = {"median": float(np.median(radius[has])), "largest": float(np.max(radius[has]))}
    judged = has & np.isfinite(error)
    if not np.any(judged):
        return told
    ratio = error[judged] / np.maximum(radius[judged], 1e-12)
    return told | {"violations": int(np.count_nonzero(ratio > 1.0)), "tightness": float(np.max(ratio))}


def _fixes(log: Log, evidence: Evidence) -> dict[int, _Fix]:
    """Positions of leader and follower by capture time, of frames that are whole."""
    names = topics_of(evidence.scenario)
    fixes: dict[int, _Fix] = {}
    if topics.RIGID_BODIES not in log.topics:
        raise UsageError(f"log {log.path}: --certify needs motion capture of the leader; it has none")
    for record in log.records([topics.RIGID_BODIES]):
        try:
            frame = read_frame(record.payload, names.leader, names.follower)
        except RefusedError:
            continue
        fixes[frame.capture_ns] = (*frame.leader, frame.follower.x, frame.follower.y)
    return fixes
