"""The estimator daemon: mocap frames or sightings and odometry in, estimates of the leader out."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import asdict
from dataclasses import replace as with_changes

from msgspec import Struct, field
from msgspec.structs import replace

from estimation.estimate import Estimate, estimate_at
from estimation.estimators import settling
from estimation.host_time import HostTime
from estimation.inputs import History, InputTrust, follower_motion, remember
from estimation.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body,
    measure_body_from_mocap,
    measure_world,
)
from estimation.motion import FollowerMotion
from estimation.odometry_correction import (
    IDEAL,
    NOTHING_SEEN,
    Watch,
    reconsidered,
    with_pose,
    with_sample,
)
from estimation.own_motion import (
    OwnNoise,
    OwnTrack,
    fold,
    own_motion,
    refolded,
)
from estimation.retelling import retold
from estimation.screening import Cause
from estimation.tracking import Status, Track, Tracker, TrackSettings, Verdict, cause_at
from formation.angles import wrap
from formation.pose import Pose
from hil.nodes.frame_time import FrameTime
from hil.nodes.leader_filter import leader_filter, offsets_report
from hil.nodes.node import (
    Counts,
    Event,
    Outgoing,
    consumed,
    counted,
    diagnostics,
    named_counts,
    no_counts,
    outgoing,
)
from hil.scenario.files import refuse_unrunnable
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.estimate_message import AssumedErrors, to_message
from hil.wire.intake import RefusedError, read_frame, read_odometry, read_sighting
from hil.wire.message_types import Consumed
from hil.wire.topics import topics_of

NAME = "estimator"
_TICK_NS = 50_000_000
_DIAGNOSTICS_NS = 500_000_000
_SAME_PLACE = 1e-3  # two robots whose centres are this close [m] are one body under two names
_NS = 1e-9
_MOST_RECEIPTS = 4096  # odometry without any frame must not fill the memory; its history is far shorter
_HISTORY = 2.0  # seconds of own motion kept, enough for the latest frame that the ring can take

REASONS = {
    Status.INITIALISING: "speed and bearing of the leader not yet known well enough",
    Status.TRACKING: "",
    Status.COASTING: "no measurement of late",
    Status.REJECTING: "newest measurement outside the gate",
    Status.LOST: "no usable measurement for too long",
}
REJECTIONS = {
    Cause.GATED: REASONS[Status.REJECTING],
    Cause.FOLLOWER: "follower not where its own motion took it",
    Cause.FLIPPED: "follower's heading turned round",
    Cause.SWAPPED: "leader and follower have changed places",
    Cause.FROZEN: "last pose of a moving body repeated",
}


class EstimatorState(Struct, frozen=True):
    """All that the estimator remembers.

    ``own``: the follower's own mocap track, empty where odometry alone tells of its motion. ``times``: what
    is known of the clock that frames are stamped by. ``watch``: how odometry compares with mocap.
    ``receipts``: inputs since the last estimate. ``refused``: inputs that were not used, by cause. ``taken``:
    inputs that were used, by kind. ``last_status``: of the last estimate that went out.
    """

    track: Track = ()
    history: History = ()
    own: OwnTrack = ()
    times: HostTime = HostTime()
    watch: Watch = NOTHING_SEEN
    receipts: tuple[Consumed, ...] = ()
    refused: Counts = field(default_factory=no_counts)
    taken: Counts = field(default_factory=no_counts)
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0
    last_out_ns: int = 0


class EstimatorNode:
    """Pure step of the estimator of one follower. Raises :class:`UsageError` for one that is not live.

    ``others``: names of further robots that the motion capture shows.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, others: frozenset[str] = frozenset()) -> None:
        refuse_unrunnable(scenario)
        given = scenario.estimator
        self.name = name
        self.others = others
        self.scenario = scenario
        self.topics = topics_of(scenario)
        self.front_end = FrontEnd(given.front_end)
        settled, unsettled = settling(given.kind)
        settings = TrackSettings(
            gate_probability=given.gate_probability,
            reacquire_frames=given.reacquire_frames,
            coast_after=given.coast_after_s,
            lost_after=given.lost_after_s,
            window=given.window_s,
            settled_heading=settled,
            unsettled_heading=unsettled,
        )
        self.tracker = Tracker(leader_filter(scenario), settings)
        self.trust = InputTrust(
            given.sigma_v2,
            given.sigma_u2,
            given.input_delay_s,
            given.input_lag_s,
            scenario.controller.v_max,
            scenario.controller.u_max,
        )
        self.pose_noise = PoseNoise(given.sigma_position, given.sigma_heading)
        self.own_noise = OwnNoise(self.pose_noise, scenario.controller.v_max, scenario.controller.u_max)
        self.assumed = AssumedErrors.of(scenario)
        self.frame_time = FrameTime(scenario)
        # The literal way to compare with takes its inputs as they come.
        self.retells = given.own_motion != "mocap" and given.kind != "difference"
        self.aligns = given.align_odometry and given.own_motion != "mocap"
        self._handlers: dict[str, Callable[[EstimatorState, bytes, int], EstimatorState]] = {
            topics.RIGID_BODIES: self._on_frame,
            self.topics.odom: self._on_odometry,
            self.topics.sighting: self._on_sighting,
        }
        self.subscribes = tuple(self._handlers)

    def begin(self, now_ns: int) -> EstimatorState:
        """State of an estimator that has seen nothing."""
        return EstimatorState(next_tick_ns=now_ns, next_diagnostics_ns=now_ns)

    def due_ns(self, state: EstimatorState) -> int:
        """Time of the next tick."""
        return state.next_tick_ns

    def step(
        self, state: EstimatorState, event: Event, now_ns: int
    ) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Take in a frame, a sighting, odometry, or a tick; every new measurement gives an estimate."""
        if not event.topic:
            return self._tick(state, now_ns)
        handler = self._handlers.get(event.topic)
        if handler is None:
            return state, ()
        receipts = (*state.receipts, consumed(event, now_ns))[-_MOST_RECEIPTS:]
        state = replace(state, receipts=receipts)
        before = state.track
        try:
            state = handler(state, event.payload, now_ns)
        except RefusedError as refusal:
            return replace(state, refused=counted(state.refused, refusal.cause)), ()
        if state.track is before or event.topic == self.topics.odom:
            return state, ()
        return self._publish(state, now_ns)

    def estimate(self, state: EstimatorState, now_ns: int) -> Estimate | None:
        """Newest estimate, its status as seen at ``now_ns``."""
        if not state.track:
            return None
        return estimate_at(state.track[-1], self.tracker.status(state.track, now_ns))

    def _on_frame(self, state: EstimatorState, payload: bytes, now_ns: int) -> EstimatorState:
        frame = read_frame(payload, self.topics.leader, self.topics.follower, others=self.others)
        timed = self.frame_time.of(state.times, frame, now_ns)
        state = replace(state, times=timed.times)
        if timed.refusal:
            return replace(state, refused=counted(state.refused, timed.refusal))
        if timed.restart:
            state = replace(state, track=(), own=())
        capture_ns = timed.capture_ns
        state = replace(state, taken=counted(state.taken, "frames"))
        if frame.strangers:
            state = replace(state, refused=counted(state.refused, "unknown_body"))
        leader, follower = frame.leader, frame.follower
        if math.dist(leader, (follower.x, follower.y)) < _SAME_PLACE:
            raise RefusedError("same_place")
        if self.aligns:
            watch = reconsidered(with_pose(state.watch, capture_ns, follower), now_ns)
            state = replace(state, watch=watch)
        own, motion = self._own_motion(state, capture_ns, follower)
        measure = measure_world if self.front_end is FrontEnd.WORLD else measure_body_from_mocap
        return self._add(state, measure(capture_ns, leader, follower, self.pose_noise, motion), own)

    def _own_motion(
        self, state: EstimatorState, capture_ns: int, pose: Pose
    ) -> tuple[OwnTrack, FollowerMotion]:
        """Own track with a pose in it, if one is kept, and the follower's motion at its capture time."""
        source = self.scenario.estimator.own_motion
        by_odometry = self._by_odometry(state, capture_ns)
        if source == "odometry":
            return (), by_odometry
        fused = by_odometry if source == "fused" and state.history else None
        own = fold(state.own, capture_ns, pose, fused, self.own_noise, self.tracker.settings.window)
        return own, own_motion(own, capture_ns) or by_odometry

    def _by_odometry(self, state: EstimatorState, capture_ns: int) -> FollowerMotion:
        """Motion of the follower as odometry tells it, put right where that is known to be wrong."""
        applied = state.watch.applied
        if applied == IDEAL:
            return follower_motion(state.history, capture_ns, self.trust)
        trust = with_changes(self.trust, delay=self.trust.delay + applied.delay)
        told = follower_motion(state.history, capture_ns, trust)
        return with_changes(told, v2=applied.scale_v * told.v2, u2=applied.scale_u * told.u2)

    def _on_sighting(self, state: EstimatorState, payload: bytes, now_ns: int) -> EstimatorState:
        if self.front_end is FrontEnd.WORLD:
            raise RefusedError("sighting_without_body_front_end")
        sighting = read_sighting(payload, now_ns)
        state = replace(state, taken=counted(state.taken, "frames"))
        motion = self._by_odometry(state, sighting.capture_ns)
        given = self.scenario.estimator
        rho, alpha2 = sighting.rho - given.range_bias, float(wrap(sighting.alpha2 - given.bearing_bias))
        if rho <= 0.0:
            raise RefusedError("bad_range")
        measurement = measure_body(
            sighting.capture_ns, rho, alpha2, given.sigma_range, given.sigma_bearing, motion
        )
        return self._add(state, measurement)

    def _on_odometry(self, state: EstimatorState, payload: bytes, now_ns: int) -> EstimatorState:
        sample = read_odometry(payload, now_ns)
        history = remember(state.history, sample, _HISTORY)
        state = replace(state, history=history, taken=counted(state.taken, "odometry"))
        if self.aligns:
            state = replace(state, watch=with_sample(state.watch, sample))
        return self._with_late_odometry(state, sample.stamp_ns)

    def _with_late_odometry(self, state: EstimatorState, stamp_ns: int) -> EstimatorState:
        """Tell again what came after the sample before this one, where that was taken in already."""
        source = self.scenario.estimator.own_motion
        place = bisect.bisect_left(state.history, stamp_ns, key=lambda kept: kept.stamp_ns)
        delay_ns = round((self.trust.delay + state.watch.applied.delay) / _NS)
        since_ns = state.history[place - 1].stamp_ns + delay_ns + 1 if place else 0
        newest_ns = state.track[-1].measurement.capture_ns if state.track else 0
        if not self.retells or newest_ns < since_ns:
            return state

        def by_odometry(capture_ns: int) -> FollowerMotion | None:
            return self._by_odometry(state, capture_ns)

        if source == "odometry":
            return replace(state, track=retold(self.tracker, state.track, since_ns, by_odometry))
        own = refolded(state.own, since_ns, by_odometry, self.own_noise)

        def fused(capture_ns: int) -> FollowerMotion | None:
            return own_motion(own, capture_ns)

        return replace(state, own=own, track=retold(self.tracker, state.track, since_ns, fused))

    def _add(self, state: EstimatorState, measurement: Measurement, own: OwnTrack = ()) -> EstimatorState:
        late = bool(state.track) and measurement.capture_ns < state.track[-1].measurement.capture_ns
        track, verdict = self.tracker.add(state.track, measurement)
        cause = cause_at(track, measurement.capture_ns) if verdict is Verdict.GATED else None
        # A follower's pose that is not believed must not move its own track either.
        if own and verdict not in (Verdict.DUPLICATE, Verdict.LATE) and cause in (None, Cause.GATED):
            track = self._retold(state.track, measurement, own) if late else track
            state = replace(state, own=own)
        if verdict in (Verdict.DUPLICATE, Verdict.LATE, Verdict.GATED):
            state = replace(state, refused=counted(state.refused, (cause or verdict).value))
        else:
            state = replace(state, taken=counted(state.taken, "used"))
        if late and verdict is not Verdict.DUPLICATE:
            state = replace(state, taken=counted(state.taken, "late"))
        return replace(state, track=track)

    def _retold(self, track: Track, measurement: Measurement, own: OwnTrack) -> Track:
        """Track with a late measurement at its place, and what follows it with the motion known since."""
        place = sum(point.measurement.capture_ns < measurement.capture_ns for point in track)
        later = [point.measurement for point in track[place:]]
        track = track[:place]
        for due in (measurement, *later):
            motion = own_motion(own, due.capture_ns) or due.motion
            track, _ = self.tracker.add(track, with_changes(due, motion=motion))
        return track

    def _publish(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        estimate = self.estimate(state, now_ns)
        if estimate is None:
            return state, ()
        reason = reason_for(estimate.status, state.track)
        message = to_message(estimate, now_ns, self.topics.follower, reason, self.assumed, state.receipts)
        out = outgoing(self.topics.estimate, message, estimate.capture_ns)
        return replace(state, receipts=(), last_out_ns=now_ns), (out,)

    def _tick(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Speak up while measurements are missing, and report on the node itself."""
        out: tuple[Outgoing, ...] = ()
        status = self.tracker.status(state.track, now_ns)
        if status in (Status.COASTING, Status.LOST) and (now_ns - state.last_out_ns) * 2 > _TICK_NS:
            state, out = self._publish(state, now_ns)
        if now_ns >= state.next_diagnostics_ns:
            out = (*out, self.report(state, now_ns))
            state = replace(state, next_diagnostics_ns=now_ns + _DIAGNOSTICS_NS)
        return replace(state, next_tick_ns=now_ns + _TICK_NS), out

    def report(self, state: EstimatorState, now_ns: int) -> Outgoing:
        """Diagnostics: status of the track, inputs taken and refused."""
        moving = state.own if self.scenario.estimator.own_motion == "mocap" else state.history
        problem = "" if state.track and moving else "waiting for mocap and odometry"
        status = self.tracker.status(state.track, now_ns)
        values: dict[str, object] = {"status": status.name.lower()}
        values |= self.frame_time.report(state.times)
        values |= offsets_report(state.track[-1].belief) if state.track else {}
        if self.aligns:
            values |= {f"odometry.{name}": value for name, value in asdict(state.watch.applied).items()}
        values |= named_counts("taken", state.taken) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)


def reason_for(status: Status, track: Track) -> str:
    """Why an estimate does not have the status TRACKING; empty if it has."""
    cause = track[-1].cause
    return REJECTIONS[cause] if status is Status.REJECTING and cause is not None else REASONS[status]
