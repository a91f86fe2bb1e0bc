"""What an estimator remembers of leader and follower, changed in place by one call for every message.

Where the filter is a record, all of it lies in rows and the calls are compiled. An estimator that cannot be
compiled goes through the very same functions in plain Python, over lists in the place of rows.
"""

from __future__ import annotations

from typing import Any, cast

from estimation.filters.filter import Filter
from estimation.models.measurement import Measurement, PairSeen
from estimation.own_motion.odometry_history import IDEAL, Correction, History, MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.estimate import Estimate
from estimation.tracking.track import Track, as_filter
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.tracker import Status, newest, status_of
from formation.records import Rows, columns_of, load, row_of, rows_of, store
from formation.ring import EMPTY
from hil.nodes import estimator_step as step
from hil.nodes.estimator_step import FUSED, MOCAP, ODOMETRY, Known, Memory, Outcome, Rules, Told
from hil.scenario.leader_model import input_trust, leader_filter, own_noise, pose_noise, track_settings
from hil.scenario.schema import Scenario

HISTORY = 2.0
"""Seconds of odometry kept, enough for the latest frame that the ring can take."""

_FASTEST = 1000.0  # messages a second; what comes faster pushes older ones out
_LEAST_ROOM = 64
_SOURCES = {"odometry": ODOMETRY, "mocap": MOCAP, "fused": FUSED}
_NOTHING = Known(EMPTY, EMPTY, EMPTY, IDEAL)


def rules_of(scenario: Scenario) -> Rules:
    """All that is fixed about a scenario's estimator; raises :class:`UsageError` as its filter does."""
    given = scenario.estimator
    return Rules(
        settings=track_settings(scenario),
        filter=as_filter(leader_filter(scenario)),
        source=_SOURCES[given.own_motion],
        # The literal way to compare with takes its inputs as they come.
        reprocesses=given.own_motion != "mocap" and given.kind != "difference",
        span=HISTORY,
        noise=pose_noise(scenario),
        trust=input_trust(scenario),
        own_noise=own_noise(scenario),
    )


def room_for(seconds: float, rate: float = _FASTEST) -> int:
    """Places that a ring needs for messages of so many seconds at a rate [Hz]: a power of two."""
    return 1 << max(_LEAST_ROOM - 1, int(seconds * rate)).bit_length()


class EstimatorMemory:
    """Tracks of leader and follower, and odometry."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self._room = room_for(rules.settings.window)
        self._compiled = isinstance(rules.filter, Filter)
        self._history = rows_of(MotionSample, room_for(rules.span))
        self._own = rows_of(OwnPoint, self._room)
        self._known = row_of(_NOTHING)
        self._sample = rows_of(MotionSample, 1)
        self.newest = rows_of(Estimate, 1)
        if self._compiled:
            from hil.nodes import estimator_entries as entries

            self._entries = entries
            self._points = rows_of(TrackPoint, self._room)
            self._rules = row_of(rules)
            self._shown, self._seen = rows_of(entries.Shown, 1), rows_of(Measurement, 1)
        else:
            self._points = cast("Rows[TrackPoint]", [None] * self._room)

    def copy(self) -> EstimatorMemory:
        """The same memory, to go on from twice."""
        twin = EstimatorMemory(self.rules)
        for name in ("_points", "_history", "_own", "_known"):
            setattr(twin, name, getattr(self, name).copy())
        return twin

    @property
    def known(self) -> Known:
        """Where the rows are filled."""
        return load(Known, self._known, 0)

    @property
    def track(self) -> Track:
        """Points of the leader's track, oldest first."""
        ring = self.known.track
        return tuple(
            load(TrackPoint, self._points, (ring.first + k) % self._room) for k in range(ring.length)
        )

    @property
    def begun(self) -> bool:
        """Whether there is a track of the leader."""
        return bool(columns_of(self._known)["track"]["length"][0] > 0)

    @property
    def history(self) -> History:
        """Odometry, oldest first."""
        ring, room = self.known.odometry, room_for(self.rules.span)
        return tuple(load(MotionSample, self._history, (ring.first + k) % room) for k in range(ring.length))

    def forget(self) -> None:
        """Know nothing any more."""
        store(self._known, 0, _NOTHING._replace(correction=self.known.correction))

    def forget_tracks(self) -> None:
        """Know nothing of where leader and follower are."""
        store(self._known, 0, self.known._replace(track=EMPTY, own=EMPTY))

    def correct(self, correction: Correction) -> None:
        """Correct odometry so from now on."""
        store(self._known, 0, self.known._replace(correction=correction))

    def take_frame(self, capture_ns: int, seen: PairSeen) -> Outcome:
        """Take in a mocap frame that was captured at a time by the host's clock."""
        if self._compiled:
            store(self._shown, 0, self._entries.Shown(capture_ns, seen))
            return self._entries.frame(*self._memory, self._known, self._rules, self._shown)
        taken = step.take_frame(self.known, self._memory, self.rules, capture_ns, seen)
        return self._taken(taken)

    def take_sighting(self, measurement: Measurement) -> Outcome:
        """Take in a sighting; its motion is looked up here."""
        if self._compiled:
            store(self._seen, 0, measurement)
            return self._entries.sighting(*self._memory, self._known, self._rules, self._seen)
        known = self.known
        motion = step.by_odometry(known, self._memory, self.rules, measurement.capture_ns)
        return self._taken(step.take(known, self._memory, self.rules, measurement._replace(motion=motion)))

    def take_odometry(self, sample: MotionSample) -> None:
        """Take in a sample of odometry, and fold again what came after the sample before it."""
        if self._compiled:
            store(self._sample, 0, sample)
            self._entries.odometry(*self._memory, self._known, self._rules, self._sample)
        else:
            store(self._known, 0, step.take_odometry(self.known, self._memory, self.rules, sample))

    def estimate(self, now_ns: int) -> Told | None:
        """Newest estimate and why the newest measurement was not used; None before there is any."""
        cause = self.tell(now_ns)
        return None if cause is None else Told(load(Estimate, self.newest, 0), cause)

    def tell(self, now_ns: int) -> int | None:
        """As :meth:`estimate`, which is left in ``newest``, a row; returns the cause alone."""
        if not self.begun:
            return None
        if self._compiled:
            return self._entries.estimate(self._points, self._known, self._rules, now_ns, self.newest)
        told = step.estimate(self.known, self._points, self.rules, now_ns)
        store(self.newest, 0, told.estimate)
        return told.cause

    def status(self, now_ns: int) -> Status:
        """Status of the track for one who looks at it at ``now_ns``."""
        if not self.begun:
            return Status.INITIALISING
        if self._compiled:
            return Status(self._entries.status(self._points, self._known, self._rules, now_ns))
        return Status(status_of(newest(self._points, self.known.track), now_ns, self.rules.settings))

    @property
    def _memory(self) -> Memory:
        return Memory(self._points, self._history, self._own)

    def _taken(self, taken: Any) -> Outcome:
        store(self._known, 0, taken.known)
        return step.outcome_of(taken)
