"""What an estimator remembers of leader and follower, changed in place by one or two calls for every message.

Where the filter is a record, all of it lies in rows and the calls are compiled. An estimator that cannot be
compiled goes through the very same functions in plain Python, with a list in the place of its track.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from estimation.consistency.filter_bank import Member
from estimation.consistency.slip_estimate import BANK
from estimation.filters.filter import Filter
from estimation.own_motion.odometry_check import OdometrySample, WayEntry
from estimation.own_motion.odometry_history import (
    Correction,
    History,
    MotionSample,
    answer_again,
    time_constant_of,
)
from estimation.own_motion.own_track import OwnPoint
from estimation.time.host_time import TimeRows, time_rows
from estimation.tracking.estimate import Estimate
from estimation.tracking.track import Track, as_filter
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.tracker import Status
from formation.kernel import compiles
from formation.lending import lent
from formation.records import R, Rows, columns_of, load, plain_rows_of, row_of, rows_of, store
from formation.ring import Ring, place
from hil.nodes import estimator_inputs as inputs
from hil.nodes.counting import Count, counts_in
from hil.nodes.estimator_desk import (
    NOTHING_KNOWN,
    NOTHING_NOTED,
    Desk,
    NodeRules,
    Notes,
    SensorRules,
    TimedFrame,
)
from hil.nodes.estimator_records import AUTO, FUSED, MOCAP, ODOMETRY, Known, MountRules, Rules, Told
from hil.nodes.estimator_step import estimate
from hil.nodes.frame_time import time_rules
from hil.nodes.node import Counts
from hil.nodes.refusals import COUNTED, REFUSALS, TAKEN, TAKEN_FRAME
from hil.nodes.status_reasons import ALL_REASONS
from hil.scenario.leader_model import (
    finds_slip,
    follower_mount,
    input_trust,
    leader_filter,
    noise_learning,
    own_noise,
    pose_noise,
    process_learning,
    track_settings,
)
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.cdr import packed_texts
from hil.wire.messages import in_little_endian
from hil.wire.reading import FrameReader
from hil.wire.records import Receipt, Sighting, Wanted
from hil.wire.templates import Template
from hil.wire.writing import MOST_RECEIPTS

if TYPE_CHECKING:
    from hil.nodes.estimator_entries import Steps

HISTORY = 4.0
"""Seconds of odometry kept, enough for the latest frame that the ring can take."""

WAYS = 64
"""Entries of the ways by which odometry is judged: more than six seconds of them."""

_FASTEST = 1000.0  # messages a second; what comes faster pushes older ones out
_LEAST_ROOM = 64
_SOURCES = {"odometry": ODOMETRY, "mocap": MOCAP, "fused": FUSED, "auto": AUTO}
_REASONS = packed_texts(ALL_REASONS)
_FRAME, _SIGHTING, _ODOMETRY = (
    kind.__msgtype__ for kind in (msg.RigidBodies, msg.RangeBearing, msg.Odometry)
)


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
        noise_learning=noise_learning(scenario),
        process_learning=process_learning(scenario),
        learns_slip=finds_slip(scenario),
        mounts=MountRules(follower_mount(scenario), scenario.controller.mount_check == "stop"),
    )


def node_rules(scenario: Scenario, times_at: int) -> NodeRules:
    """All that is fixed about a scenario's estimator node.

    Raises :class:`UsageError` as :func:`rules_of` and :func:`hil.nodes.frame_time.time_rules` do.
    """
    given = scenario.estimator
    sensor = SensorRules(
        given.front_end == "body",
        given.range_bias,
        given.bearing_bias,
        given.sensor_x,
        given.sensor_y,
        given.sigma_range,
        given.sigma_bearing,
    )
    step, time = rules_of(scenario), time_rules(scenario)
    return NodeRules(step, time, sensor, AssumedErrors.of(scenario), times_at)


def room_for(seconds: float, rate: float = _FASTEST) -> int:
    """Places that a ring needs for messages of so many seconds at a rate [Hz]: a power of two."""
    return 1 << max(_LEAST_ROOM - 1, int(seconds * rate)).bit_length()


class EstimatorMemory:
    """All that the node of an estimator keeps in rows, and its steps on them.

    ``reader``, ``wanted``: by what it looks at frames. ``template``: of the estimates that it tells; the
    steps that return a number return the length of the message that stands in there then, 0 for none. What
    each step does stands at :mod:`hil.nodes.estimator_entries`.
    """

    def __init__(
        self, rules: NodeRules, reader: FrameReader, wanted: Rows[Wanted], template: Template
    ) -> None:
        self.rules, self.reader = rules, reader
        self._wanted, self._template = wanted, template
        self._compiled = isinstance(rules.step.filter, Filter) and compiles()
        make = rows_of if self._compiled else plain_rows_of
        room = room_for(rules.step.settings.window)
        self.desk = Desk(
            rules=row_of(rules) if self._compiled else cast("Rows[NodeRules]", [rules]),
            points=make(TrackPoint, room),
            history=rows_of(MotionSample, room_for(rules.step.span)),
            own=rows_of(OwnPoint, room),
            ways=rows_of(WayEntry, WAYS),
            bank=rows_of(Member, BANK),
            known=row_of(NOTHING_KNOWN),
            time=time_rows(),
            notes=row_of(NOTHING_NOTED),
            receipts=rows_of(Receipt, MOST_RECEIPTS),
            counts=rows_of(Count, COUNTED),
            frame=rows_of(TimedFrame, 1),
            sample=rows_of(OdometrySample, 1),
            sighting=rows_of(Sighting, 1),
            newest=rows_of(Estimate, 1),
            buffer=template.buffer,
            heads=reader.heads,
            bodies=reader.bodies,
            wanted=wanted,
        )
        self._lent = lent(self.desk) if self._compiled else cast("Rows[Desk]", [self.desk])
        self._capture_ns = columns_of(self.desk.newest)["capture_ns"]

    @functools.cached_property
    def _steps(self) -> Steps:
        """The steps, loaded once somebody takes one: a replay in one pass has entries of its own."""
        from hil.nodes.estimator_entries import COMPILED, PLAIN

        return COMPILED if self._compiled else PLAIN

    def load(self) -> None:
        """Load the steps, so that the first one need not wait for that."""
        _ = self._steps

    def copy(self) -> EstimatorMemory:
        """The same memory, to go on from twice."""
        twin = EstimatorMemory(self.rules, self.reader, self._wanted, self._template)
        rows = ("points", "history", "own", "ways", "bank", "known", "notes", "receipts", "counts", "newest")
        for name in rows:
            getattr(twin.desk, name)[:] = getattr(self.desk, name)
        for kept, other in zip(_columns(self.desk.time), _columns(twin.desk.time), strict=True):
            other[:] = kept
        return twin

    def see_frame(self, payload: bytes, digest: int, now_ns: int) -> int:
        """Read a frame; what comes of it."""
        reader = self.reader
        again = reader.again(payload)
        whole = payload if again else in_little_endian(payload, _FRAME)
        return self._steps.see_frame(self._lent, whole, reader.packed, again, digest, now_ns)

    def see_sighting(self, payload: bytes, digest: int, now_ns: int) -> int:
        """Read a sighting; what comes of it."""
        whole = in_little_endian(payload, _SIGHTING)
        return self._steps.see_sighting(self._lent, whole, digest, now_ns)

    def see_odometry(self, payload: bytes, digest: int, now_ns: int) -> int:
        """Read odometry; what comes of it."""
        whole = in_little_endian(payload, _ODOMETRY)
        return self._steps.see_odometry(self._lent, whole, digest, now_ns)

    def take_frame(self, now_ns: int) -> int:
        """Take in the frame that was seen."""
        return self._steps.take(self._lent, inputs.FRAME, _REASONS, now_ns)

    def take_sighting(self, now_ns: int) -> int:
        """Take in the sighting that was seen."""
        return self._steps.take(self._lent, inputs.SIGHTING, _REASONS, now_ns)

    def take_odometry(self) -> None:
        """Take in the odometry that was seen."""
        self._steps.take(self._lent, inputs.ODOMETRY, _REASONS, 0)

    def tick(self, now_ns: int) -> int:
        """Estimate if no measurement has led to that for a while."""
        return self._steps.tick(self._lent, _REASONS, now_ns)

    def message(self, length: int) -> tuple[bytes, int]:
        """The message that a step has written, and the capture time that it speaks of."""
        return self.desk.buffer[:length].tobytes(), self._capture_ns.item(0)

    def estimate(self, now_ns: int) -> Told | None:
        """Newest estimate and why the newest measurement was not used; None before there is any."""
        return estimate(self.known, self.desk.points, self.rules.step, now_ns) if self.begun else None

    def status(self, now_ns: int) -> Status:
        """Status of the track for one who looks at it at ``now_ns``."""
        return Status(self._steps.status(self._lent, now_ns)) if self.begun else Status.INITIALISING

    def correct(self, correction: Correction) -> None:
        """Correct odometry so from now on."""
        known, trust = self.known, self.rules.step.trust
        time_constant = time_constant_of(trust, correction)
        if time_constant not in (0.0, time_constant_of(trust, known.correction)):
            answer_again(self.desk.history, known.odometry, 0, time_constant)
        store(self.desk.known, 0, known._replace(correction=correction))

    @property
    def known(self) -> Known:
        """Where the rows are filled."""
        return load(Known, self.desk.known, 0)

    @property
    def notes(self) -> Notes:
        """What is remembered beside the tracks."""
        return load(Notes, self.desk.notes, 0)

    @property
    def frame(self) -> TimedFrame:
        """The frame that was seen last."""
        return load(TimedFrame, self.desk.frame, 0)

    @property
    def sample(self) -> OdometrySample:
        """The odometry that was seen last."""
        return load(OdometrySample, self.desk.sample, 0)

    @property
    def sighting(self) -> Sighting:
        """The sighting that was seen last, put right."""
        return load(Sighting, self.desk.sighting, 0)

    @property
    def track(self) -> Track:
        """Points of the leader's track, oldest first."""
        return tuple(_held(TrackPoint, self.desk.points, self.known.track))

    @property
    def begun(self) -> bool:
        """Whether there is a track of the leader."""
        return self.known.track.length > 0

    @property
    def history(self) -> History:
        """Odometry, oldest first."""
        return tuple(_held(MotionSample, self.desk.history, self.known.odometry))

    @property
    def ways(self) -> tuple[WayEntry, ...]:
        """Ways of odometry and the follower's own track, oldest first, where both are known."""
        check = self.known.odometry_check
        return tuple(_held(WayEntry, self.desk.ways, check.entries)[: check.paired])

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """Receipts of the inputs since the last estimate."""
        return tuple(load(Receipt, self.desk.receipts, k) for k in range(self.notes.receipts))

    @property
    def taken(self) -> Counts:
        """How many inputs were used, by kind."""
        return counts_in(self.desk.counts, TAKEN, TAKEN_FRAME)

    @property
    def refused(self) -> Counts:
        """How many were not, by cause."""
        return counts_in(self.desk.counts, REFUSALS)


def _held(kind: type[R], rows: Rows[R], ring: Ring) -> list[R]:
    return [load(kind, rows, place(ring, rows, k)) for k in range(ring.length)]


def _columns(time: TimeRows) -> list[NDArray[np.void]]:
    """All rows that are known of a clock."""
    clock = time.clock
    known = [columns_of(clock.lowest), columns_of(clock.recent), columns_of(clock.suspects)]
    return [*known, columns_of(time.knots)]
