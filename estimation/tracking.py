"""From measurements in any order to a belief with a status: gate, re-acquisition, coasting, rewind ring.

A track is a fold: ``point = follow(point, measurement)`` in the order of capture times. A ring of the last
points lets a late measurement be folded in where it belongs, so that the result is what delivery in order
would have given.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Protocol

from estimation.belief import Belief, Model, innovation
from estimation.measurement import Measurement
from estimation.motion import FollowerMotion

_NS = 1e-9


class Status(IntEnum):
    """How far an estimate can be trusted; only TRACKING may move a robot.

    INITIALISING: speed and bearing of the leader are not yet known well enough. TRACKING: all well.
    COASTING: no measurement for a while. REJECTING: the newest measurement did not pass the gate.
    LOST: nothing usable for so long that the next measurement starts anew.
    """

    INITIALISING = 0
    TRACKING = 1
    COASTING = 2
    REJECTING = 3
    LOST = 4


class Verdict(Enum):
    """What became of a measurement."""

    USED = "used"
    GATED = "gated"
    RESTARTED = "restarted"
    LATE = "too_late"
    DUPLICATE = "duplicate"


class Estimator(Protocol):
    """A recursive estimator: pure, its whole state is the belief.

    Those that derive from it have ``step`` out of their ``predict`` and ``update``.
    """

    model: Model

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement at the belief's time."""

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> tuple[Belief, float]:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement.

        One whose NIS is above ``gate`` is left out: the belief is then the prediction.
        """
        prior = self.predict(belief, dt, follower)
        nis = innovation(prior, measurement).nis
        return (self.update(prior, measurement) if nis <= gate else prior), nis


@dataclass(frozen=True, slots=True)
class TrackSettings:
    """When to believe a measurement and when to believe the estimate.

    gate_probability: share of good measurements that pass the chi-square gate.
    reacquire_frames: rejected measurements that must agree with each other before they take over.
    coast_after, lost_after, window: [s]. settled_heading, unsettled_heading: standard deviation of the
    leader's direction [rad] below which a track settles, and above which it no longer counts as settled.
    """

    gate_probability: float = 0.9999
    reacquire_frames: int = 5
    coast_after: float = 0.25
    lost_after: float = 1.0
    window: float = 0.2
    settled_heading: float = 0.25
    unsettled_heading: float = 0.6


@dataclass(frozen=True, slots=True)
class Candidate:
    """A second belief made of rejected measurements only, waiting for enough of them to agree."""

    belief: Belief
    capture_ns: int
    motion: FollowerMotion
    frames: int


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """The track right after one measurement. ``used_ns``: capture time of the newest one that was used."""

    measurement: Measurement
    belief: Belief
    verdict: Verdict
    nis: float
    used_ns: int
    settled: bool
    candidate: Candidate | None = None


Track = tuple[TrackPoint, ...]


class Tracker:
    """Folds measurements into tracks with one estimator. Holds no state of its own between calls."""

    def __init__(self, estimator: Estimator, settings: TrackSettings) -> None:
        self.estimator = estimator
        self.settings = settings
        # With two degrees of freedom the chi-square quantile has this closed form.
        self._gate = -2.0 * math.log1p(-settings.gate_probability)

    def add(self, track: Track, measurement: Measurement) -> tuple[Track, Verdict]:
        """Fold a measurement in at its place in time; return the new track and what became of it.

        A measurement of a capture time that the track has is a DUPLICATE, one from before the window or
        before the track began is LATE: both leave the track as it is. The verdict of one folded in late is
        that at its own place.
        """
        if not track:
            return (self.begin(measurement),), Verdict.RESTARTED
        if measurement.capture_ns > track[-1].measurement.capture_ns:
            point = self.follow(track[-1], measurement)
            return self._trim((*track, point)), point.verdict
        times = [point.measurement.capture_ns for point in track]
        place = bisect.bisect_left(times, measurement.capture_ns)
        if times[place] == measurement.capture_ns:
            return track, Verdict.DUPLICATE
        if place == 0 or measurement.capture_ns < self._window_begin_ns(track):
            return track, Verdict.LATE
        points = list(track[:place])
        for due in (measurement, *(point.measurement for point in track[place:])):
            points.append(self.follow(points[-1], due))
        return tuple(points), points[place].verdict

    def begin(self, measurement: Measurement) -> TrackPoint:
        """First point of a track that knows nothing but this measurement."""
        belief = self.estimator.start(measurement)
        return TrackPoint(
            measurement, belief, Verdict.RESTARTED, math.nan, measurement.capture_ns, settled=False
        )

    def follow(self, last: TrackPoint, measurement: Measurement) -> TrackPoint:
        """Fold one measurement, newer than the point, into it."""
        dt = (measurement.capture_ns - last.measurement.capture_ns) * _NS
        if (measurement.capture_ns - last.used_ns) * _NS > self.settings.lost_after:
            return self.begin(measurement)
        follower = mean_motion(last.measurement.motion, measurement.motion)
        belief, nis = self.estimator.step(last.belief, dt, follower, measurement, self._gate)
        if nis <= self._gate:
            settled = self.settled(belief, last.settled)
            return TrackPoint(measurement, belief, Verdict.USED, nis, measurement.capture_ns, settled)
        candidate = self._nurse(last.candidate, measurement)
        if candidate.frames >= self.settings.reacquire_frames:
            settled = self.settled(candidate.belief, before=False)
            return TrackPoint(
                measurement, candidate.belief, Verdict.RESTARTED, nis, measurement.capture_ns, settled
            )
        settled = self.settled(belief, last.settled)
        return TrackPoint(measurement, belief, Verdict.GATED, nis, last.used_ns, settled, candidate)

    def status(self, track: Track, now_ns: int) -> Status:
        """Status of the track's newest point for one who looks at it at ``now_ns``."""
        if not track:
            return Status.INITIALISING
        newest = track[-1]
        silence = (now_ns - newest.used_ns) * _NS
        if silence > self.settings.lost_after:
            return Status.LOST
        if newest.verdict is Verdict.GATED:
            return Status.REJECTING
        if silence > self.settings.coast_after:
            return Status.COASTING
        return Status.TRACKING if newest.settled else Status.INITIALISING

    def _nurse(self, candidate: Candidate | None, measurement: Measurement) -> Candidate:
        """Let a rejected measurement join the candidate, or start a new one if they do not agree."""
        if candidate is not None:
            dt = (measurement.capture_ns - candidate.capture_ns) * _NS
            follower = mean_motion(candidate.motion, measurement.motion)
            belief, nis = self.estimator.step(candidate.belief, dt, follower, measurement, self._gate)
            if nis <= self._gate:
                return Candidate(belief, measurement.capture_ns, measurement.motion, candidate.frames + 1)
        return Candidate(self.estimator.start(measurement), measurement.capture_ns, measurement.motion, 1)

    def settled(self, belief: Belief, before: bool) -> bool:
        """Whether the leader's direction is known well enough, for a track that was settled before or not."""
        settings, limits = self.settings, self.estimator.model.limits
        if belief.speed < 0.5 * limits.v_eps:
            return False
        return belief.sd_heading < (settings.unsettled_heading if before else settings.settled_heading)

    def _window_begin_ns(self, track: Track) -> int:
        return track[-1].measurement.capture_ns - round(self.settings.window / _NS)

    def _trim(self, track: Track) -> Track:
        """Ring of the points in the window and the one before, which anything in the window can follow."""
        oldest_ns = self._window_begin_ns(track)
        first = next(i for i, point in enumerate(track) if point.measurement.capture_ns >= oldest_ns)
        return track[first - 1 :] if first > 1 else track


def mean_motion(a: FollowerMotion, b: FollowerMotion) -> FollowerMotion:
    """Mean motion over an interval, from the motions at its ends (trapezoid)."""
    return FollowerMotion(0.5 * (a.v2 + b.v2), 0.5 * (a.u2 + b.u2), b.sd_v2, b.sd_u2)
