"""From measurements in any order to a belief with a status: gates, re-acquisition, coasting, rewind ring.

A track is a fold: ``point = follow(point, measurement)`` in the order of capture times. A ring of the last
points lets a late measurement be folded in where it belongs, so that the result is what delivery in order
would have given.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, replace
from enum import Enum, IntEnum

from estimation.filters.belief import Belief
from estimation.filters.estimator import Estimator
from estimation.models.measurement import Measurement
from estimation.own_motion.inputs import mean_motion
from estimation.tracking.candidate import Candidate, jump, nursed, turned
from estimation.tracking.screening import (
    NO_DOUBT,
    STANDING,
    Cause,
    Doubt,
    Watch,
    carried,
    cause_of,
    looked_at,
    watch_from,
)

_NS = 1e-9


class Status(IntEnum):
    """How far an estimate can be trusted; only TRACKING may move a robot.

    INITIALISING: speed and bearing of the leader are not yet known well enough. TRACKING: all well.
    COASTING: no measurement for a while. REJECTING: the newest measurement did not pass the gates.
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


@dataclass(frozen=True, slots=True)
class TrackSettings:
    """When to believe a measurement and when to believe the estimate.

    gate_probability: share of good measurements that pass a chi-square gate.
    reacquire_frames: rejected measurements that must agree with each other before they take over.
    coast_after, lost_after, window: [s]. doubt_for: how long [s] a jump stays in doubt.
    settled_heading, unsettled_heading: standard deviation of the leader's direction [rad] below which a track
    settles, and above which it no longer counts as settled.
    capped_speed: whether a leader that seems faster than k_v settles as one of k_v would.
    followed_turn: how far [rad] a jump may turn alpha1 and alpha2 for the track to follow it.
    """

    gate_probability: float = 0.9999
    reacquire_frames: int = 5
    coast_after: float = 0.25
    lost_after: float = 1.0
    window: float = 0.2
    doubt_for: float = 2.0
    settled_heading: float = 0.35
    unsettled_heading: float = 0.6
    capped_speed: bool = True
    followed_turn: float = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class TrackPoint:
    """The track right after one measurement.

    ``used_ns``: capture time of the newest one that was used. ``watch``: what the screen of the follower's
    pose knows, None while no mocap frame has come. ``cause``: why the measurement was not used, if so.
    ``doubt``: jumps that were followed of late.
    """

    measurement: Measurement
    belief: Belief
    verdict: Verdict
    nis: float
    used_ns: int
    settled: bool
    candidate: Candidate | None = None
    watch: Watch | None = None
    cause: Cause | None = None
    doubt: Doubt = NO_DOUBT


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
        return TrackPoint(
            measurement,
            self.estimator.start(measurement),
            Verdict.RESTARTED,
            math.nan,
            measurement.capture_ns,
            settled=False,
            watch=None if measurement.seen is None else watch_from(measurement.seen),
        )

    def follow(self, last: TrackPoint, measurement: Measurement) -> TrackPoint:
        """Fold one measurement, newer than the point, into it.

        It is used if the leader passes the gate and the frame the screen. If not, it joins the candidate,
        which takes over when enough measurements agree and the jump is small against the distance: more than
        that no robot does, and it has time until the track is lost.
        """
        if (measurement.capture_ns - last.used_ns) * _NS > self.settings.lost_after:
            return self._found(last, measurement)
        dt = (measurement.capture_ns - last.measurement.capture_ns) * _NS
        watch, cause = self._screened(last, measurement, dt)
        # Nothing passes a negative gate: the belief is then the prediction.
        gate = self._gate if cause is None else -1.0
        motion = mean_motion(last.measurement.motion, measurement.motion)
        belief, nis = self.estimator.step(last.belief, dt, motion, measurement, gate)
        settled = self.settled(belief, last.settled)
        doubt = self._lasting(last.doubt, measurement.capture_ns)
        if nis <= gate:
            return TrackPoint(
                measurement,
                belief,
                Verdict.USED,
                nis,
                measurement.capture_ns,
                settled,
                watch=watch,
                doubt=doubt,
            )
        rejected = TrackPoint(
            measurement,
            belief,
            Verdict.GATED,
            nis,
            last.used_ns,
            settled,
            None
            if cause is Cause.FROZEN
            else nursed(last.candidate, measurement, self.estimator, self._gate),
            watch,
            cause or Cause.GATED,
            doubt,
        )
        return self._taken_over(rejected) or rejected

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

    def _found(self, last: TrackPoint, measurement: Measurement) -> TrackPoint:
        """Start anew after a loss: with the candidate if it is ripe, unless the frame is plainly wrong.

        What was lost is not moved on, so that a body that stays frozen leads nowhere.
        """
        dt = (measurement.capture_ns - last.measurement.capture_ns) * _NS
        watch, cause = self._screened(last, measurement, dt)
        if cause in STANDING:
            return replace(
                last, measurement=measurement, verdict=Verdict.GATED, nis=math.nan, settled=False,
                candidate=None, watch=watch, cause=cause,
            )  # fmt: skip
        begun = self.begin(measurement)
        candidate = nursed(last.candidate, measurement, self.estimator, self._gate)
        if candidate.frames < self.settings.reacquire_frames:
            return begun
        return replace(begun, belief=candidate.belief, settled=self.settled(candidate.belief, before=False))

    def _screened(
        self, last: TrackPoint, measurement: Measurement, dt: float
    ) -> tuple[Watch | None, Cause | None]:
        """Watch at the measurement, and what there is against its frame; a sighting has none."""
        seen, watch = measurement.seen, last.watch
        if watch is not None:
            watch = carried(watch, last.measurement.motion, measurement.motion, dt)
        if seen is None:
            return watch, None
        if watch is None:
            return watch_from(seen), None
        leader_moves = last.belief.speed >= 0.5 * self.estimator.model.limits.v_eps
        watch, off = looked_at(watch, seen, self._gate, leader_moves=leader_moves)
        return watch, cause_of(watch, off, self._gate)

    def _taken_over(self, rejected: TrackPoint) -> TrackPoint | None:
        """Point of a candidate that takes over, in doubt by its jump; None if it is not ripe or goes too far.

        Too far is what would turn the line between the robots, and with it alpha1 and alpha2, by more than
        ``followed_turn``.
        """
        candidate, measurement = rejected.candidate, rejected.measurement
        if candidate is None or candidate.frames < self.settings.reacquire_frames:
            return None
        prior, leader_fits = rejected.belief, rejected.nis <= self._gate
        doubt = jump(rejected.doubt, measurement, prior, rejected.watch, leader_fits=leader_fits)
        if turned(doubt, measurement) > self.settings.followed_turn:
            return None
        belief = self.estimator.update(prior, measurement) if leader_fits else candidate.belief
        return TrackPoint(
            measurement,
            belief,
            Verdict.RESTARTED,
            rejected.nis,
            measurement.capture_ns,
            self.settled(belief, before=leader_fits and rejected.settled),
            watch=candidate.watch or rejected.watch,
            doubt=doubt,
        )

    def _lasting(self, doubt: Doubt, now_ns: int) -> Doubt:
        """Doubt as it is now: a body that has stayed where it jumped for long enough is there."""
        return doubt if (now_ns - doubt.since_ns) * _NS <= self.settings.doubt_for else NO_DOUBT

    def settled(self, belief: Belief, before: bool) -> bool:
        """Whether the leader's direction is known well enough, for a track that was settled before or not.

        The first few measurements may make a leader seem faster than any is, and its direction the better
        known by as much. What is above k_v therefore doesn't help to settle, unless the settings let it.
        """
        settings, limits, speed = self.settings, self.estimator.model.limits, belief.speed
        if speed < 0.5 * limits.v_eps:
            return False
        if before:
            return belief.sd_heading < settings.unsettled_heading
        excess = max(1.0, speed / limits.k_v) if settings.capped_speed else 1.0
        return belief.sd_heading * excess < settings.settled_heading

    def _window_begin_ns(self, track: Track) -> int:
        return track[-1].measurement.capture_ns - round(self.settings.window / _NS)

    def _trim(self, track: Track) -> Track:
        """Ring of the points in the window and the one before, which anything in the window can follow."""
        oldest_ns = self._window_begin_ns(track)
        first = next(i for i, point in enumerate(track) if point.measurement.capture_ns >= oldest_ns)
        return track[first - 1 :] if first > 1 else track


def cause_at(track: Track, capture_ns: int) -> Cause | None:
    """Why the measurement of a capture time was not used; None if it was, or the track does not have it."""
    return next((point.cause for point in track if point.measurement.capture_ns == capture_ns), None)
