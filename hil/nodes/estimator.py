"""The estimator daemon: mocap frames or sightings and odometry in, estimates of the leader out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from dataclasses import replace as with_changes

from msgspec import Struct, field
from msgspec.structs import replace

from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    from_sensor,
    measure_body,
    measure_body_from_mocap,
    measure_world,
)
from estimation.own_motion.inputs import remember
from estimation.own_motion.odometry_correction import reconsidered, with_pose, with_sample
from estimation.own_motion.own_track import OwnTrack
from estimation.time.host_time import HostTime
from estimation.tracking.estimate import Estimate, estimate_at
from estimation.tracking.screening import Cause
from estimation.tracking.tracker import Status, Track, Verdict, cause_at
from formation.angles import wrap
from hil.nodes.certifying import Believed, certifying
from hil.nodes.frame_time import FrameTime
from hil.nodes.leader_filter import leader_tracker, offsets_report
from hil.nodes.node import (
    Counts,
    Outgoing,
    consumed,
    counted,
    diagnostics,
    is_due,
    named_counts,
    no_counts,
    outgoing,
)
from hil.nodes.own_motion_source import OwnMotion, OwnMotionSource, with_late_pose
from hil.nodes.status_reasons import reason_for
from hil.scenario.files import refuse_unrunnable
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.certified_message import certified_message
from hil.wire.estimate_message import AssumedErrors, to_message
from hil.wire.events import Event
from hil.wire.message_checks import CLOCK_TOLERANCE_NS
from hil.wire.message_types import Consumed
from hil.wire.reading import RefusedError, read_frame, read_odometry, read_sighting
from hil.wire.topics import topics_of

NAME = "estimator"
_TICK_NS = 50_000_000
_DIAGNOSTICS_NS = 500_000_000
_SAME_PLACE = 1e-3  # two robots whose centres are this close [m] are one body under two names
_MOST_RECEIPTS = 4096  # odometry without any frame must not fill the memory; its history is far shorter
_HISTORY = 2.0  # seconds of own motion kept, enough for the latest frame that the ring can take


class EstimatorState(Struct, frozen=True):
    """All that the estimator remembers.

    ``track``: of the leader. ``own``: what was heard of the follower's motion. ``times``: what is known of
    the clock that frames are stamped by. ``believed``: what certificates rest on, if any are asked for.
    ``receipts``: inputs since the last estimate. ``refused``: inputs that were not used, by cause. ``taken``:
    inputs that were used, by kind. ``heard_ns``: when the newest input came.
    """

    track: Track = ()
    own: OwnMotion = OwnMotion()
    times: HostTime = HostTime()
    believed: Believed = Believed()
    receipts: tuple[Consumed, ...] = ()
    refused: Counts = field(default_factory=no_counts)
    taken: Counts = field(default_factory=no_counts)
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0
    last_out_ns: int = 0
    heard_ns: int = 0


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
        self.tracker = leader_tracker(scenario)
        self.source = OwnMotionSource(scenario, self.tracker.settings.window)
        self.pose_noise = PoseNoise(given.sigma_position, given.sigma_heading)
        self.assumed = AssumedErrors.of(scenario)
        self.frame_time = FrameTime(scenario)
        self.certifying = certifying(scenario)
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
        if now_ns < state.heard_ns - CLOCK_TOLERANCE_NS:
            # The clock was set back: all that comes would be too late for what was heard before.
            state = replace(state, track=(), own=OwnMotion(), believed=Believed())
        receipts = (*state.receipts, consumed(event, now_ns))[-_MOST_RECEIPTS:]
        state = replace(state, receipts=receipts, heard_ns=now_ns)
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
            forgotten = with_changes(state.own, track=())
            state = replace(state, track=(), own=forgotten, believed=Believed())
        capture_ns = timed.capture_ns
        state = replace(state, taken=counted(state.taken, "frames"))
        if frame.strangers:
            state = replace(state, refused=counted(state.refused, "unknown_body"))
        leader, follower = frame.leader, frame.follower
        if math.dist(leader, (follower.x, follower.y)) < _SAME_PLACE:
            raise RefusedError("same_place")
        if self.source.aligns:
            watch = reconsidered(with_pose(state.own.watch, capture_ns, follower), now_ns)
            state = replace(state, own=with_changes(state.own, watch=watch))
        own, motion = self.source.at_pose(state.own, capture_ns, follower)
        measure = measure_world if self.front_end is FrontEnd.WORLD else measure_body_from_mocap
        return self._add(state, measure(capture_ns, leader, follower, self.pose_noise, motion), own)

    def _on_sighting(self, state: EstimatorState, payload: bytes, now_ns: int) -> EstimatorState:
        if self.front_end is FrontEnd.WORLD:
            raise RefusedError("sighting_without_body_front_end")
        sighting = read_sighting(payload, now_ns)
        state = replace(state, taken=counted(state.taken, "frames"))
        motion = self.source.by_odometry(state.own, sighting.capture_ns)
        given = self.scenario.estimator
        rho, alpha2 = sighting.rho - given.range_bias, float(wrap(sighting.alpha2 - given.bearing_bias))
        if rho <= 0.0:
            raise RefusedError("bad_range")
        if given.sensor_x or given.sensor_y:
            rho, alpha2 = from_sensor(rho, alpha2, (given.sensor_x, given.sensor_y))
        if rho < _SAME_PLACE:
            raise RefusedError("same_place")
        measurement = measure_body(
            sighting.capture_ns, rho, alpha2, given.sigma_range, given.sigma_bearing, motion
        )
        return self._add(state, measurement)

    def _on_odometry(self, state: EstimatorState, payload: bytes, now_ns: int) -> EstimatorState:
        sample = read_odometry(payload, now_ns)
        own = with_changes(state.own, history=remember(state.own.history, sample, _HISTORY))
        if self.source.aligns:
            own = with_changes(own, watch=with_sample(own.watch, sample))
        own_track, track = self.source.with_late_odometry(own, state.track, self.tracker, sample.stamp_ns)
        own = with_changes(own, track=own_track)
        return replace(state, own=own, track=track, taken=counted(state.taken, "odometry"))

    def _add(self, state: EstimatorState, measurement: Measurement, own: OwnTrack = ()) -> EstimatorState:
        late = bool(state.track) and measurement.capture_ns < state.track[-1].measurement.capture_ns
        track, verdict = self.tracker.add(state.track, measurement)
        cause = cause_at(track, measurement.capture_ns) if verdict is Verdict.GATED else None
        # A follower's pose that is not believed must not move its own track either.
        if own and verdict not in (Verdict.DUPLICATE, Verdict.LATE) and cause in (None, Cause.GATED):
            track = with_late_pose(self.tracker, state.track, measurement, own) if late else track
            state = replace(state, own=with_changes(state.own, track=own))
        if verdict in (Verdict.DUPLICATE, Verdict.LATE, Verdict.GATED):
            state = replace(state, refused=counted(state.refused, (cause or verdict).value))
        else:
            state = replace(state, taken=counted(state.taken, "used"))
            if self.certifying is not None:
                state = replace(state, believed=self.certifying.heard(state.believed, measurement))
        if late and verdict is not Verdict.DUPLICATE:
            state = replace(state, taken=counted(state.taken, "late"))
        return replace(state, track=track)

    def _publish(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        estimate = self.estimate(state, now_ns)
        if estimate is None:
            return state, ()
        reason = reason_for(estimate.status, state.track)
        message = to_message(estimate, now_ns, self.topics.follower, reason, self.assumed, state.receipts)
        out = [outgoing(self.topics.estimate, message, estimate.capture_ns)]
        if self.certifying is not None:
            certain = self.certifying.certain(state.believed, state.own.history, estimate.capture_ns)
            certified = certified_message(estimate, certain, now_ns, self.topics.follower)
            out.append(outgoing(self.topics.certified, certified, estimate.capture_ns))
        return replace(state, receipts=(), last_out_ns=now_ns), tuple(out)

    def _tick(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Speak up while measurements are missing, and report on the node itself."""
        out: tuple[Outgoing, ...] = ()
        status = self.tracker.status(state.track, now_ns)
        if status in (Status.COASTING, Status.LOST) and (now_ns - state.last_out_ns) * 2 > _TICK_NS:
            state, out = self._publish(state, now_ns)
        if is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            out = (*out, self.report(state, now_ns))
            state = replace(state, next_diagnostics_ns=now_ns + _DIAGNOSTICS_NS)
        return replace(state, next_tick_ns=now_ns + _TICK_NS), out

    def report(self, state: EstimatorState, now_ns: int) -> Outgoing:
        """Diagnostics: status of the track, inputs taken and refused."""
        moving = state.own.track if self.source.kind == "mocap" else state.own.history
        problem = "" if state.track and moving else "waiting for mocap and odometry"
        status = self.tracker.status(state.track, now_ns)
        values: dict[str, object] = {"status": status.name.lower()}
        values |= self.frame_time.report(state.times)
        values |= offsets_report(state.track[-1].belief) if state.track else {}
        if self.source.aligns:
            values |= {f"odometry.{name}": value for name, value in asdict(state.own.watch.applied).items()}
        values |= named_counts("taken", state.taken) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)
