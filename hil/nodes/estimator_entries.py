"""The estimator's step, compiled: what Python enters once for every message that comes in."""

from __future__ import annotations

from typing import NamedTuple

from estimation.models.measurement import Measurement, PairSeen
from estimation.own_motion.odometry_history import MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.estimate import Estimate
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.tracker import newest, status_of
from formation.kernel import entry
from formation.records import Rows, borrowed, load, store
from hil.nodes.estimator_step import Known, Memory, Outcome, Rules, by_odometry, outcome_of, take, take_frame
from hil.nodes.estimator_step import estimate as newest_estimate
from hil.nodes.estimator_step import take_odometry as taken_odometry


class Shown(NamedTuple):
    """A mocap frame, captured at a time by the host's clock."""

    capture_ns: int
    seen: PairSeen


@entry
def frame(
    points: Rows[TrackPoint],
    history: Rows[MotionSample],
    own: Rows[OwnPoint],
    known: Rows[Known],
    rules: Rows[Rules],
    shown: Rows[Shown],
) -> Outcome:
    """Take in a mocap frame."""
    memory, here = Memory(borrowed(points), borrowed(history), borrowed(own)), load(Shown, shown, 0)
    taken = take_frame(load(Known, known, 0), memory, load(Rules, rules, 0), here.capture_ns, here.seen)
    store(known, 0, taken.known)
    return outcome_of(taken)


@entry
def sighting(
    points: Rows[TrackPoint],
    history: Rows[MotionSample],
    own: Rows[OwnPoint],
    known: Rows[Known],
    rules: Rows[Rules],
    measurements: Rows[Measurement],
) -> Outcome:
    """Take in a sighting whose measurement still lacks the follower's motion."""
    memory, fixed = Memory(borrowed(points), borrowed(history), borrowed(own)), load(Rules, rules, 0)
    now, due = load(Known, known, 0), load(Measurement, measurements, 0)
    motion = by_odometry(now, memory, fixed, due.capture_ns)
    taken = take(now, memory, fixed, due._replace(motion=motion))
    store(known, 0, taken.known)
    return outcome_of(taken)


@entry
def odometry(
    points: Rows[TrackPoint],
    history: Rows[MotionSample],
    own: Rows[OwnPoint],
    known: Rows[Known],
    rules: Rows[Rules],
    samples: Rows[MotionSample],
) -> None:
    """Take in a sample of odometry."""
    memory = Memory(borrowed(points), borrowed(history), borrowed(own))
    sample = load(MotionSample, samples, 0)
    after = taken_odometry(load(Known, known, 0), memory, load(Rules, rules, 0), sample)
    store(known, 0, after)


@entry
def status(points: Rows[TrackPoint], known: Rows[Known], rules: Rows[Rules], now_ns: int) -> int:
    """Status of a track that has a point, for one who looks at it at ``now_ns``."""
    point = newest(borrowed(points), load(Known, known, 0).track)
    return status_of(point, now_ns, load(Rules, rules, 0).settings)


@entry
def estimate(
    points: Rows[TrackPoint], known: Rows[Known], rules: Rows[Rules], now_ns: int, estimates: Rows[Estimate]
) -> int:
    """Fill in the newest estimate of a track that has one, and tell the cause of its point."""
    told = newest_estimate(load(Known, known, 0), borrowed(points), load(Rules, rules, 0), now_ns)
    store(estimates, 0, told.estimate)
    return told.cause
