"""Tracks in plain Python: the functions of :mod:`estimation.tracking.tracker` over tuples of points.

For whoever folds a track by hand: the smoother, a notebook, a test. Daemons keep their points in rows.
"""

from __future__ import annotations

from typing import cast

from estimation.filters.estimator import Estimator, Interpreted
from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian
from estimation.models.measurement import Measurement
from estimation.tracking import tracker
from estimation.tracking.track_point import TrackPoint, Verdict, begun
from estimation.tracking.track_settings import TrackSettings
from estimation.tracking.tracker import Status
from formation.records import Rows, load, plain_rows_of, store
from formation.ring import Ring

Track = tuple[TrackPoint, ...]


def as_filter(estimator: Filter | Estimator) -> Filter:
    """What the functions of the loop take: the filter itself, or an estimator in matrices in its place."""
    return estimator if isinstance(estimator, Filter) else cast("Filter", Interpreted(estimator))


class Tracker:
    """Folds measurements into tracks with one estimator. Holds no state of its own between calls."""

    def __init__(self, estimator: Filter | Estimator, settings: TrackSettings) -> None:
        self.estimator = as_filter(estimator)
        self.settings = settings

    def begin(self, measurement: Measurement) -> TrackPoint:
        """First point of a track that knows nothing but this measurement."""
        return begun(measurement, self.estimator)

    def follow(self, last: TrackPoint, measurement: Measurement) -> TrackPoint:
        """Fold one measurement, newer than the point, into it; see :func:`.tracker.fold`."""
        points = plain_rows_of(TrackPoint, 2)
        store(points, 0, last)
        tracker.fold(points, 0, 1, measurement, self.settings, self.estimator)
        return load(TrackPoint, points, 1)

    def add(self, track: Track, measurement: Measurement) -> tuple[Track, Verdict]:
        """Fold a measurement in at its place in time; see :func:`estimation.tracking.tracker.add`."""
        room = 1 << len(track).bit_length()
        points: list[TrackPoint] = (
            [*track, *[track[-1]] * (room - len(track))] if track else [self.begin(measurement)]
        )
        rows = cast("Rows[TrackPoint]", points)
        added = tracker.add(rows, Ring(0, len(track)), measurement, self.settings, self.estimator)
        first, length = added.ring
        return tuple(points[(first + k) % room] for k in range(length)), Verdict(added.verdict)

    def status(self, track: Track, now_ns: int) -> Status:
        """Status of the track's newest point for one who looks at it at ``now_ns``."""
        if not track:
            return Status.INITIALISING
        return Status(tracker.status_of(track[-1], now_ns, self.settings))

    def settled(self, belief: Gaussian, before: bool) -> bool:
        """Whether the leader's direction is known well enough, for a track that was settled before or not."""
        return tracker.is_settled(belief, before, self.settings, self.estimator.limits)
