"""The estimator daemon: mocap frames or sightings and odometry in, estimates of the leader out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from estimation.bounds.certified import Certain, Failed
from estimation.own_motion.odometry_correction import (
    NOTHING_SEEN,
    OdometryComparison,
    correction_report,
    reconsidered,
    with_pose,
    with_sample,
)
from estimation.own_motion.odometry_history import MotionSample
from estimation.time.host_time import HostTime
from estimation.tracking.estimate import Estimate
from estimation.tracking.sideways_check import NO_SIDEWAYS_CHECK, SidewaysCheck, with_ways
from estimation.tracking.track_point import DUPLICATE, GATED, LATE
from formation.records import load
from hil.nodes.certifying import Believed, certifying
from hil.nodes.estimator_inputs import RESTARTED, SEEN, SET_BACK, TICK_NS
from hil.nodes.estimator_memory import EstimatorMemory, node_rules
from hil.nodes.estimator_records import AUTO, MOCAP, Known
from hil.nodes.findings import Findings, named_findings
from hil.nodes.frame_findings import bodies_text, clock_rule, frame_findings
from hil.nodes.frame_looks import LOOK_NS, Look, look_at, names_in, recent, with_look
from hil.nodes.frame_time import clock_report
from hil.nodes.leader_findings import leader_findings, limits_findings
from hil.nodes.leader_mount import UNWATCHED, LeaderMountWatch, with_leader
from hil.nodes.mount_report import mount_findings, mount_problem, mount_report
from hil.nodes.node import Counts, Outgoing, diagnostics, is_due, named_counts, outgoing
from hil.nodes.noise_report import is_refuted, noise_findings, noise_report, scale_of
from hil.nodes.odometry_findings import odometry_findings
from hil.nodes.own_motion_step import is_under_way
from hil.nodes.process_report import process_report
from hil.nodes.sensor_offsets import offsets_report
from hil.scenario.files import refuse_unrunnable
from hil.scenario.leader_model import leader_mount
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.certified_message import certified_message
from hil.wire.events import Event
from hil.wire.message_checks import Cause, planar
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import typename_of
from hil.wire.reading import frame_reader
from hil.wire.records import Body, Receipt
from hil.wire.templates import estimate_template
from hil.wire.topics import topics_of
from hil.wire.writing import MOST_RECEIPTS

NAME = "estimator"
_DIAGNOSTICS_NS = 500_000_000
_ESTIMATE = typename_of(LeaderEstimate)
_UNUSED = (GATED, DUPLICATE, LATE)
FRAME_CAUSES = {cause.word for cause in Cause}


@dataclass(slots=True, eq=False)
class EstimatorState:
    """All that the estimator remembers; it changes in place.

    ``memory``: tracks, clock, receipts and counts, in rows. ``leader_mount``, ``sideways``: how the leader's
    body sits on it, and the follower's beside its wheels' middle, for a word. ``comparison``: how odometry
    compares with mocap. ``believed``: what certificates rest on, if any are asked for. ``looks``: at frames,
    used or not, the newest of which came as ``looked_at``.
    """

    memory: EstimatorMemory
    leader_mount: LeaderMountWatch = UNWATCHED
    sideways: SidewaysCheck = NO_SIDEWAYS_CHECK
    comparison: OdometryComparison = NOTHING_SEEN
    believed: Believed = field(default_factory=Believed)
    looks: tuple[Look, ...] = ()
    looked_at: bytes = b""
    next_look_ns: int = 0
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0

    def copy(self) -> EstimatorState:
        """The same state, to go on from twice."""
        return replace(self, memory=self.memory.copy())

    @property
    def times(self) -> HostTime:
        """What is known of the clock that frames are stamped by."""
        return self.memory.notes.times

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """Inputs since the last estimate."""
        return self.memory.receipts

    @property
    def taken(self) -> Counts:
        """Inputs that were used, by kind."""
        return self.memory.taken

    @property
    def refused(self) -> Counts:
        """Inputs that were not used, by cause."""
        return self.memory.refused

    @property
    def noise_scale(self) -> float | None:
        """Noise of positions as it is found over what is told, None where it is given."""
        return scale_of(self.memory.known.noise, self.memory.rules.step.noise_learning)


class EstimatorNode:
    """Step of the estimator of one follower. Raises :class:`UsageError` for one that is not live.

    ``others``: further bodies that the motion capture shows.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, others: frozenset[str] = frozenset()) -> None:
        refuse_unrunnable(scenario)
        given = scenario.estimator
        self.name = name
        self.scenario = scenario
        self.topics = topics_of(scenario)
        leader, follower = bodies_of(scenario)
        self._reader = frame_reader(others | {leader, follower})
        self._bodies = (leader, follower)
        self._wanted, self._leader_at = self._reader.pair(leader, follower), self._reader.names.index(leader)
        self._clock_rule = clock_rule(scenario)
        self._leader_mount = leader_mount(scenario)
        self._template = estimate_template(self.topics.follower, MOST_RECEIPTS)
        self.rules = node_rules(scenario, self._template.numbers_at)
        self.aligns = given.align_odometry and given.own_motion != "mocap"
        self.certifying = certifying(scenario)
        self._handlers: dict[str, Callable[[EstimatorState, Event, int], int]] = {
            topics.RIGID_BODIES: self._on_frame,
            self.topics.odom: self._on_odometry,
            self.topics.sighting: self._on_sighting,
        }
        self._estimate = self.topics.estimate
        self.subscribes = tuple(self._handlers)

    @property
    def packed_names(self) -> bytes:
        """Names of the bodies that are known, as kernels take them."""
        return self._reader.packed

    def begin(self, now_ns: int) -> EstimatorState:
        """State of an estimator that has seen nothing."""
        state = self.rows_only(now_ns)
        state.memory.load()
        return state

    def rows_only(self, now_ns: int) -> EstimatorState:
        """The same for who steps it by entries of his own."""
        memory = EstimatorMemory(self.rules, self._reader, self._wanted, self._template)
        return EstimatorState(memory, next_tick_ns=now_ns, next_diagnostics_ns=now_ns)

    def due_ns(self, state: EstimatorState) -> int:
        """Time of the next tick."""
        return state.next_tick_ns

    def step(
        self, state: EstimatorState, event: Event, now_ns: int
    ) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Take in a frame, a sighting, odometry, or a tick; every new measurement gives an estimate."""
        if not event.topic:
            return state, self._tick(state, now_ns)
        handler = self._handlers.get(event.topic)
        length = handler(state, event, now_ns) if handler is not None else 0
        return state, self._messages(state, length, now_ns) if length else ()

    def _on_frame(self, state: EstimatorState, event: Event, now_ns: int) -> int:
        memory = state.memory
        came = memory.see_frame(event.payload, event.signed_digest, now_ns)
        if is_due(state.next_look_ns, LOOK_NS, now_ns):
            self._look(state, event.payload, now_ns)
        if came != SEEN and not self._is_seen(state, came):
            return 0
        frame, body = memory.frame, load(Body, self._reader.bodies, self._leader_at)
        state.leader_mount = with_leader(
            state.leader_mount,
            frame.capture_ns,
            planar(body.place),
            self._leader_mount,
            self.rules.step.noise,
        )
        if self.aligns:
            with_frame = with_pose(state.comparison, frame.capture_ns, frame.seen.follower)
            state.comparison = reconsidered(with_frame, now_ns, self.rules.step.trust)
            memory.correct(state.comparison.applied)
        length = memory.take_frame(now_ns)
        if self.certifying is not None and memory.notes.verdict not in _UNUSED:
            seen = frame.seen
            leader = (seen.leader_x, seen.leader_y)
            state.believed = self.certifying.heard_frame(
                state.believed, frame.capture_ns, leader, seen.follower
            )
        return length

    def _look(self, state: EstimatorState, payload: bytes, now_ns: int) -> None:
        """Look at the frame that was read just now, whether it is used or not."""
        state.next_look_ns, state.looked_at = now_ns + LOOK_NS, payload
        leader, follower = map(self._reader.names.index, self._bodies)
        look = look_at(self._reader, payload, leader, follower, now_ns)
        if look is not None:
            state.looks = with_look(state.looks, look)

    def _on_sighting(self, state: EstimatorState, event: Event, now_ns: int) -> int:
        memory = state.memory
        came = memory.see_sighting(event.payload, event.signed_digest, now_ns)
        if came != SEEN and not self._is_seen(state, came):
            return 0
        length = memory.take_sighting(now_ns)
        if self.certifying is not None and memory.notes.verdict not in _UNUSED:
            _, capture_ns, rho, alpha2 = memory.sighting
            state.believed = self.certifying.heard_sighting(state.believed, capture_ns, rho, alpha2)
        return length

    def _on_odometry(self, state: EstimatorState, event: Event, now_ns: int) -> int:
        memory = state.memory
        came = memory.see_odometry(event.payload, event.signed_digest, now_ns)
        if came != SEEN and not self._is_seen(state, came):
            return 0
        if self.aligns:
            told = memory.sample
            sample = MotionSample(told.stamp_ns, told.v2, told.u2)
            state.comparison = with_sample(state.comparison, sample)
        memory.take_odometry()
        return 0

    def _is_seen(self, state: EstimatorState, came: int) -> bool:
        """Whether an input can be used that may not be like the ones before."""
        if came & (RESTARTED | SET_BACK):
            state.believed = Believed()
        if came & SET_BACK:
            state.comparison, state.leader_mount = NOTHING_SEEN, UNWATCHED
            state.sideways = NO_SIDEWAYS_CHECK
        return bool(came & SEEN)

    def _messages(self, state: EstimatorState, length: int, now_ns: int) -> tuple[Outgoing, ...]:
        """An estimate whose message has a length, and what is certain of it if that is asked for."""
        payload, capture_ns = state.memory.message(length)
        estimate = Outgoing(self._estimate, _ESTIMATE, payload, capture_ns)
        if self.certifying is None:
            return (estimate,)
        newest = load(Estimate, state.memory.desk.newest, 0)
        certain: Certain | Failed = Failed.NOISE
        if not is_refuted(state.noise_scale):
            certain = self.certifying.certain(state.believed, state.memory.history, capture_ns)
        certified = certified_message(newest, certain, now_ns, self.topics.follower)
        return estimate, outgoing(self.topics.certified, certified, capture_ns)

    def _tick(self, state: EstimatorState, now_ns: int) -> tuple[Outgoing, ...]:
        """Speak up while measurements are missing, and report on the node itself."""
        length = state.memory.tick(now_ns)
        out = self._messages(state, length, now_ns) if length else ()
        if is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            out = (*out, self.report(state, now_ns))
            state.next_diagnostics_ns = now_ns + _DIAGNOSTICS_NS
        state.next_tick_ns = now_ns + TICK_NS
        return out

    def report(self, state: EstimatorState, now_ns: int) -> Outgoing:
        """Diagnostics: status of the track, inputs taken and refused."""
        known = state.memory.known
        state.sideways = with_ways(state.sideways, state.memory.ways)
        problem = "" if is_under_way(known, self.rules.step) else self._missing(state, known, now_ns)
        stops = self.rules.step.mounts.stops
        problem = problem or mount_problem(known.mount_check, stops=stops)
        values: dict[str, object] = {"status": state.memory.status(now_ns).name.lower()}
        if stops and values["status"] in ("tracking", "initialising") and known.mount_check.off:
            values["status"] = "rejecting"
        values |= mount_report(known.mount_check, state.leader_mount.check, state.sideways)
        values |= clock_report(state.times, state.memory.desk.time)
        values |= (
            offsets_report(state.memory.track[-1].belief)
            if self.scenario.estimator.bias_states and known.track.length
            else {}
        )
        values |= noise_report(known.noise, self.rules.step.noise_learning)
        values |= process_report(known.process, self.rules.step.process_learning)
        if self.aligns:
            values |= correction_report(state.comparison.applied, self.rules.step.trust)
        values |= named_counts("taken", state.taken) | named_counts("refused", state.refused)
        values |= named_findings(self.findings(state, now_ns))
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)

    def findings(self, state: EstimatorState, now_ns: int) -> Findings:
        """What is wrong with what the estimator gets, as long as it is; reads rows, and takes no step.

        A replay in one pass asks too, and has loaded none of the node's own steps.
        """
        known, rules = state.memory.known, self.rules.step
        mounts = mount_findings(known.mount_check, state.leader_mount.check, state.sideways)
        found = {**mounts, **odometry_findings(known, rules, now_ns)}
        found |= noise_findings(known.noise, rules.noise_learning)
        found |= leader_findings(known.travel, now_ns)
        if known.track.length > 0:
            found |= limits_findings(state.memory.track[-1], rules.filter.limits)
        if looks := recent(state.looks, now_ns):
            found |= frame_findings(looks, self._clock_rule)
            if looks[-1].pair is None and (wrong := bodies_text(self._bodies, names_in(state.looked_at))):
                found["bodies"] = wrong
        return found

    def _missing(self, state: EstimatorState, known: Known, now_ns: int) -> str:
        """What the estimator waits for to begin, and what of it is there."""
        if self.rules.sensor.used and known.own.length == 0:
            seen = f"sightings on {self.topics.sighting}"
        else:
            seen = f"mocap: {self._frames_missed(state, now_ns)}"
        if known.track.length == 0 and self.rules.step.source in (MOCAP, AUTO):
            return f"waiting for {seen}"
        return f"waiting for odometry on {self.topics.odom} and {seen}"

    def _frames_missed(self, state: EstimatorState, now_ns: int) -> str:
        looks = recent(state.looks, now_ns)
        if not looks:
            come = "no frame that can be read has" if state.looked_at else "no frame has"
            return f"{come} come on {topics.RIGID_BODIES}"
        if looks[-1].pair is None:
            return bodies_text(self._bodies, names_in(state.looked_at))
        refused = sorted(cause for cause in state.refused if cause in FRAME_CAUSES)
        return f"frames come and are refused as {', '.join(refused)}" if refused else "frames come"
