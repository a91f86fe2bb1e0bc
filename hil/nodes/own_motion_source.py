"""Where an estimator has its follower's motion from: odometry, its own mocap track, or both."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field, replace

from estimation.models.measurement import Measurement, PoseNoise
from estimation.models.motion import FollowerMotion
from estimation.own_motion.inputs import History, InputTrust, follower_motion
from estimation.own_motion.odometry_correction import IDEAL, NOTHING_SEEN, Watch
from estimation.own_motion.own_track import OwnNoise, OwnTrack, fold, own_motion, refolded
from estimation.tracking.retelling import retold
from estimation.tracking.tracker import Track, Tracker
from formation.pose import Pose
from hil.scenario.schema import Scenario

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class OwnMotion:
    """What has been heard of the follower's motion.

    ``history``: odometry. ``track``: the follower's own mocap track, empty where odometry alone tells of its
    motion. ``watch``: how odometry compares with mocap.
    """

    history: History = field(default=())
    track: OwnTrack = field(default=())
    watch: Watch = NOTHING_SEEN


class OwnMotionSource:
    """How a scenario tells the follower's motion at a capture time. Holds no state of its own."""

    def __init__(self, scenario: Scenario, window: float) -> None:
        given, limits = scenario.estimator, scenario.controller
        self.kind = given.own_motion
        self.window = window
        pose_noise = PoseNoise(given.sigma_position, given.sigma_heading)
        self.own_noise = OwnNoise(pose_noise, limits.v_max, limits.u_max)
        self.trust = InputTrust(
            given.sigma_v2,
            given.sigma_u2,
            given.input_delay_s,
            given.input_lag_s,
            limits.v_max,
            limits.u_max,
        )
        # The literal way to compare with takes its inputs as they come.
        self.retells = self.kind != "mocap" and given.kind != "difference"
        self.aligns = given.align_odometry and self.kind != "mocap"

    def by_odometry(self, known: OwnMotion, capture_ns: int) -> FollowerMotion:
        """Motion of the follower as odometry tells it, put right where that is known to be wrong."""
        applied = known.watch.applied
        if applied == IDEAL:
            return follower_motion(known.history, capture_ns, self.trust)
        trust = replace(self.trust, delay=self.trust.delay + applied.delay)
        told = follower_motion(known.history, capture_ns, trust)
        return replace(told, v2=applied.scale_v * told.v2, u2=applied.scale_u * told.u2)

    def at_pose(self, known: OwnMotion, capture_ns: int, pose: Pose) -> tuple[OwnTrack, FollowerMotion]:
        """Own track with a pose in it, if one is kept, and the follower's motion at its capture time."""
        by_odometry = self.by_odometry(known, capture_ns)
        if self.kind == "odometry":
            return (), by_odometry
        fused = by_odometry if self.kind == "fused" and known.history else None
        own = fold(known.track, capture_ns, pose, fused, self.own_noise, self.window)
        return own, own_motion(own, capture_ns) or by_odometry

    def with_late_odometry(
        self, known: OwnMotion, track: Track, tracker: Tracker, stamp_ns: int
    ) -> tuple[OwnTrack, Track]:
        """Own track and leader's track with what came after the sample before this one told again."""
        place = bisect.bisect_left(known.history, stamp_ns, key=lambda kept: kept.stamp_ns)
        delay_ns = round((self.trust.delay + known.watch.applied.delay) / _NS)
        since_ns = known.history[place - 1].stamp_ns + delay_ns + 1 if place else 0
        newest_ns = track[-1].measurement.capture_ns if track else 0
        if not self.retells or newest_ns < since_ns:
            return known.track, track

        def by_odometry(capture_ns: int) -> FollowerMotion | None:
            return self.by_odometry(known, capture_ns)

        if self.kind == "odometry":
            return known.track, retold(tracker, track, since_ns, by_odometry)
        own = refolded(known.track, since_ns, by_odometry, self.own_noise)

        def fused(capture_ns: int) -> FollowerMotion | None:
            return own_motion(own, capture_ns)

        return own, retold(tracker, track, since_ns, fused)


def with_late_pose(tracker: Tracker, track: Track, measurement: Measurement, own: OwnTrack) -> Track:
    """Track with a late measurement at its place, and what follows it with the motion known since."""
    place = sum(point.measurement.capture_ns < measurement.capture_ns for point in track)
    later = [point.measurement for point in track[place:]]
    track = track[:place]
    for due in (measurement, *later):
        motion = own_motion(own, due.capture_ns) or due.motion
        track, _ = tracker.add(track, replace(due, motion=motion))
    return track
