"""The estimator daemon: mocap frames or sightings and odometry in, estimates of the leader out."""

from __future__ import annotations

import math
from collections.abc import Callable

from msgspec import Struct, field
from msgspec.structs import replace

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import FrontEnd, PairSeen, from_sensor, measure_body
from estimation.own_motion.odometry_correction import (
    NOTHING_SEEN,
    OdometryComparison,
    reconsidered,
    with_pose,
    with_sample,
)
from estimation.own_motion.odometry_history import IDEAL
from estimation.time.host_time import HostTime
from estimation.tracking.estimate import Estimate
from estimation.tracking.follower_check import Cause
from estimation.tracking.track_point import DUPLICATE, GATED, LATE, Verdict
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.records import columns_of, load
from hil.nodes.certifying import Believed, certifying
from hil.nodes.estimator_memory import EstimatorMemory, rules_of
from hil.nodes.estimator_step import Outcome
from hil.nodes.frame_time import FrameTime
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
from hil.nodes.sensor_offsets import offsets_report
from hil.nodes.status_reasons import ALL_REASONS, reason_number
from hil.scenario.files import refuse_unrunnable
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.certified_message import certified_message
from hil.wire.events import Event
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import typename_of
from hil.wire.reading import RefusedError, read_frame, read_odometry, read_sighting
from hil.wire.records import Receipt
from hil.wire.topics import topics_of
from hil.wire.writing import MOST_RECEIPTS, EstimateWriter

NAME = "estimator"
_TICK_NS = 50_000_000
_DIAGNOSTICS_NS = 500_000_000
_SAME_PLACE = 1e-3  # two robots whose centres are this close [m] are one body under two names
_ESTIMATE = typename_of(LeaderEstimate)
_UNUSED = (GATED, DUPLICATE, LATE)
_UNKNOWN_MOTION = FollowerMotion(0.0, 0.0, 0.0, 0.0)


class EstimatorState(Struct, frozen=True):
    """All that the estimator remembers.

    ``memory``: of leader and follower, changed in place by whoever has the newest state. ``watch``: how
    odometry compares with mocap. ``times``: what is known of the clock that frames are stamped by.
    ``believed``: what certificates rest on, if any are asked for. ``receipts``: inputs since the last
    estimate. ``refused``: inputs that were not used, by cause. ``taken``: inputs that were used, by kind.
    ``heard_ns``: when the newest input came.
    """

    memory: EstimatorMemory
    watch: OdometryComparison = NOTHING_SEEN
    times: HostTime = HostTime()
    believed: Believed = Believed()
    receipts: tuple[Receipt, ...] = ()
    refused: Counts = field(default_factory=no_counts)
    taken: Counts = field(default_factory=no_counts)
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0
    last_out_ns: int = 0
    heard_ns: int = 0

    def copy(self) -> EstimatorState:
        """The same state with a memory of its own: a step changes that of the state it is given."""
        return replace(self, memory=self.memory.copy())


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
        self.rules = rules_of(scenario)
        EstimatorMemory(self.rules)  # now, and not with the first message, all is compiled or loaded
        self.aligns = given.align_odometry and given.own_motion != "mocap"
        self.assumed = AssumedErrors.of(scenario)
        self.writer = EstimateWriter(self.topics.follower, self.assumed, ALL_REASONS)
        self.frame_time = FrameTime(scenario)
        self.certifying = certifying(scenario)
        self._handlers: dict[str, Callable[[EstimatorState, bytes, int], tuple[EstimatorState, bool]]] = {
            topics.RIGID_BODIES: self._on_frame,
            self.topics.odom: self._on_odometry,
            self.topics.sighting: self._on_sighting,
        }
        self.subscribes = tuple(self._handlers)

    def begin(self, now_ns: int) -> EstimatorState:
        """State of an estimator that has seen nothing."""
        return EstimatorState(EstimatorMemory(self.rules), next_tick_ns=now_ns, next_diagnostics_ns=now_ns)

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
            state = self._forgotten(state)
        receipts = (*state.receipts, consumed(event, now_ns))[-MOST_RECEIPTS:]
        state = replace(state, receipts=receipts, heard_ns=now_ns)
        try:
            state, is_new = handler(state, event.payload, now_ns)
        except RefusedError as refusal:
            return replace(state, refused=counted(state.refused, refusal.cause)), ()
        return self._publish(state, now_ns) if is_new else (state, ())

    def _forgotten(self, state: EstimatorState) -> EstimatorState:
        state.memory.forget()
        state.memory.correct(IDEAL)
        return replace(state, watch=NOTHING_SEEN, believed=Believed())

    def _on_frame(self, state: EstimatorState, payload: bytes, now_ns: int) -> tuple[EstimatorState, bool]:
        frame = read_frame(payload, self.topics.leader, self.topics.follower, others=self.others)
        timed = self.frame_time.of(state.times, frame, now_ns)
        state = replace(state, times=timed.times)
        if timed.refusal:
            return replace(state, refused=counted(state.refused, timed.refusal)), False
        if timed.restart:
            state.memory.forget_tracks()
            state = replace(state, believed=Believed())
        capture_ns = timed.capture_ns
        state = replace(state, taken=counted(state.taken, "frames"))
        if frame.strangers:
            state = replace(state, refused=counted(state.refused, "unknown_body"))
        leader, follower = frame.leader, frame.follower
        if math.dist(leader, (follower.x, follower.y)) < _SAME_PLACE:
            raise RefusedError("same_place")
        if self.aligns:
            watch = reconsidered(with_pose(state.watch, capture_ns, follower), now_ns)
            state.memory.correct(watch.applied)
            state = replace(state, watch=watch)
        outcome = state.memory.take_frame(capture_ns, PairSeen(*leader, follower))
        state, is_new = self._counted(state, outcome)
        if outcome.verdict not in _UNUSED and self.certifying is not None:
            believed = self.certifying.heard_frame(state.believed, capture_ns, leader, follower)
            state = replace(state, believed=believed)
        return state, is_new

    def _on_sighting(self, state: EstimatorState, payload: bytes, now_ns: int) -> tuple[EstimatorState, bool]:
        if self.front_end is FrontEnd.WORLD:
            raise RefusedError("sighting_without_body_front_end")
        sighting = read_sighting(payload, now_ns)
        state = replace(state, taken=counted(state.taken, "frames"))
        given, capture_ns = self.scenario.estimator, sighting.capture_ns
        rho, alpha2 = sighting.rho - given.range_bias, float(wrap(sighting.alpha2 - given.bearing_bias))
        if rho <= 0.0:
            raise RefusedError("bad_range")
        if given.sensor_x or given.sensor_y:
            rho, alpha2 = from_sensor(rho, alpha2, (given.sensor_x, given.sensor_y))
        if rho < _SAME_PLACE:
            raise RefusedError("same_place")
        noise = (given.sigma_range, given.sigma_bearing)
        outcome = state.memory.take_sighting(measure_body(capture_ns, rho, alpha2, *noise, _UNKNOWN_MOTION))
        state, is_new = self._counted(state, outcome)
        if outcome.verdict not in _UNUSED and self.certifying is not None:
            believed = self.certifying.heard_sighting(state.believed, capture_ns, rho, alpha2)
            state = replace(state, believed=believed)
        return state, is_new

    def _on_odometry(self, state: EstimatorState, payload: bytes, now_ns: int) -> tuple[EstimatorState, bool]:
        sample = read_odometry(payload, now_ns)
        if self.aligns:
            state = replace(state, watch=with_sample(state.watch, sample))
        state.memory.take_odometry(sample)
        return replace(state, taken=counted(state.taken, "odometry")), False

    def _counted(self, state: EstimatorState, outcome: Outcome) -> tuple[EstimatorState, bool]:
        """State with an outcome counted, and whether the track has moved on."""
        verdict, cause = Verdict(outcome.verdict), Cause(outcome.cause)
        if verdict in _UNUSED:
            state = replace(state, refused=counted(state.refused, cause.word or verdict.word))
        else:
            state = replace(state, taken=counted(state.taken, "used"))
        if outcome.late and verdict is not Verdict.DUPLICATE:
            state = replace(state, taken=counted(state.taken, "late"))
        return state, verdict not in (Verdict.DUPLICATE, Verdict.LATE)

    def _publish(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        cause = state.memory.tell(now_ns)
        if cause is None:
            return state, ()
        newest = state.memory.newest
        capture_ns, status = columns_of(newest)[["capture_ns", "status"]][0].item()
        payload = self.writer.write(newest, reason_number(status, cause), now_ns, state.receipts)
        out = [Outgoing(self.topics.estimate, _ESTIMATE, payload, capture_ns)]
        if self.certifying is not None:
            estimate = load(Estimate, newest, 0)
            certain = self.certifying.certain(state.believed, state.memory.history, estimate.capture_ns)
            certified = certified_message(estimate, certain, now_ns, self.topics.follower)
            out.append(outgoing(self.topics.certified, certified, estimate.capture_ns))
        return replace(state, receipts=(), last_out_ns=now_ns), tuple(out)

    def _tick(self, state: EstimatorState, now_ns: int) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Speak up while measurements are missing, and report on the node itself."""
        out: tuple[Outgoing, ...] = ()
        status = state.memory.status(now_ns)
        if status in (Status.COASTING, Status.LOST) and (now_ns - state.last_out_ns) * 2 > _TICK_NS:
            state, out = self._publish(state, now_ns)
        if is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            out = (*out, self.report(state, now_ns))
            state = replace(state, next_diagnostics_ns=now_ns + _DIAGNOSTICS_NS)
        return replace(state, next_tick_ns=now_ns + _TICK_NS), out

    def report(self, state: EstimatorState, now_ns: int) -> Outgoing:
        """Diagnostics: status of the track, inputs taken and refused."""
        known = state.memory.known
        moving = known.own if self.scenario.estimator.own_motion == "mocap" else known.odometry
        problem = "" if known.track.length and moving.length else "waiting for mocap and odometry"
        values: dict[str, object] = {"status": state.memory.status(now_ns).name.lower()}
        values |= self.frame_time.report(state.times)
        values |= (
            offsets_report(state.memory.track[-1].belief)
            if self.scenario.estimator.bias_states and known.track.length
            else {}
        )
        if self.aligns:
            values |= {f"odometry.{name}": value for name, value in state.watch.applied._asdict().items()}
        values |= named_counts("taken", state.taken) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)
