"""The best that a whole log allows: a filter forward in time, then a pass backward that knows the future.

Rauch, Tung and Striebel, AIAA Journal 3(8), 1965, with the Jacobians of the motion at the filtered states.
For reference tracks out of a log; of no use to a follower that has to act now.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import ProcessNoise
from estimation.models.measurement import Measurement
from estimation.models.motion import STATE_SIZE
from estimation.tracking.follower_check import BELIEVED
from estimation.tracking.follower_check import GATED as LEADER_OFF
from estimation.tracking.track import Tracker
from estimation.tracking.track_point import TrackPoint, Verdict, no_tentative, way_to

_NS = 1e-9


def smooth(
    tracker: Tracker, measurements: Iterable[Measurement], noises: Mapping[int, ProcessNoise] | None = None
) -> tuple[TrackPoint, ...]:
    """Fold a whole track, in any order and with duplicates, and smooth it.

    ``tracker`` folds with a filter on the coordinated turn, as ``ekf`` is: its beliefs are those of the
    model. Points come in the order of capture times; verdict, NIS and time of the newest measurement used are
    those of the forward pass, the belief is the smoothed one, and whether the track is settled follows from
    it. A restart parts the track: nothing is carried back over it. ``noises``: process noise up to a capture
    time, where it is not always the filter's own.
    """
    driven = noises or {}
    forward = _forward(tracker, measurements, driven)
    backward: list[TrackPoint] = []
    for point in reversed(forward):
        if backward and backward[-1].verdict != Verdict.RESTARTED:
            point = point._replace(
                belief=_carried_back(_driven(tracker, backward[-1].measurement, driven), point, backward[-1])
            )
        backward.append(point)
    smoothed: list[TrackPoint] = []
    for point in reversed(backward):
        before = bool(smoothed) and smoothed[-1].settled and point.verdict != Verdict.RESTARTED
        settled = tracker.settled(point.belief, before)
        smoothed.append(point._replace(settled=settled, tentative=no_tentative(point.belief)))
    return tuple(smoothed)


def _driven(tracker: Tracker, due: Measurement, noises: Mapping[int, ProcessNoise]) -> Tracker:
    """Tracker whose filter takes the leader to have been driven so up to a measurement."""
    noise = noises.get(due.capture_ns)
    return tracker if noise is None else Tracker(tracker.estimator.driven_by(noise), tracker.settings)


def _forward(
    tracker: Tracker, measurements: Iterable[Measurement], noises: Mapping[int, ProcessNoise]
) -> list[TrackPoint]:
    by_capture = {each.capture_ns: each for each in measurements}
    points: list[TrackPoint] = []
    for capture_ns in sorted(by_capture):
        due = by_capture[capture_ns]
        of = _driven(tracker, due, noises)
        points.append(of.follow(points[-1], due) if points else of.begin(due))
    return points


def _carried_back(tracker: Tracker, here: TrackPoint, later: TrackPoint) -> Gaussian:
    """Belief at a point from its filtered one and the smoothed one of the next.

    With G = P F^T (F P F^T + Q)^-1 the covariance is (I - G F) P (I - G F)^T + G (Q + P_later) G^T: the
    textbook's P + G (P_later - P_prior) G^T, written as a sum of squares that stays positive definite.
    """
    model, filtered = tracker.estimator.model, here.belief
    dt = (later.measurement.capture_ns - here.measurement.capture_ns) * _NS
    follower = way_to(here, later.measurement, later.cause == BELIEVED or later.cause == LEADER_OFF, dt)
    move = model.transition(filtered.mean, dt, follower)
    noise = model.process_noise(filtered.mean, dt, follower)
    predicted = move @ filtered.covariance @ move.T + noise
    gain = np.linalg.solve(predicted, move @ filtered.covariance).T
    change = later.belief.mean - model.propagate(filtered.mean, dt, follower)
    rest = np.eye(STATE_SIZE) - gain @ move
    covariance = rest @ filtered.covariance @ rest.T + gain @ (noise + later.belief.covariance) @ gain.T
    return Gaussian.of(filtered.mean + gain @ change, 0.5 * (covariance + covariance.T))
