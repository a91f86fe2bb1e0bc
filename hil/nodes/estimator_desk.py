"""What an estimator's node works with: its rules, and the rows in which all lies that it remembers."""

from __future__ import annotations

from typing import NamedTuple

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.consistency.filter_bank import Member
from estimation.consistency.noise_estimate import NOISE_AS_TOLD, kept_noise
from estimation.consistency.process_estimate import NOTHING_LEARNED
from estimation.consistency.slip_estimate import SLIP_AS_TOLD
from estimation.models.measurement import PairSeen
from estimation.own_motion.odometry_check import UNCHECKED, OdometrySample, WayEntry, without_track
from estimation.own_motion.odometry_history import IDEAL, MotionSample
from estimation.own_motion.odometry_noise import ODOMETRY_AS_TOLD
from estimation.own_motion.own_track import OwnPoint
from estimation.time.host_time import NO_TIME_YET, HostTime, TimeRows
from estimation.tracking.estimate import Estimate
from estimation.tracking.mount_check import NO_MOUNT_CHECK
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.travel_watch import NO_TRAVEL
from formation.kernel import kernel
from formation.records import Buffer, Rows, load, store
from formation.ring import EMPTY
from hil.nodes.counting import Count
from hil.nodes.estimator_records import Known, Memory, Rules
from hil.nodes.frame_time import TimeRules
from hil.nodes.receipt_list import with_receipt
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.records import Body, FrameHead, Receipt, Sighting, Wanted


class SensorRules(NamedTuple):
    """A sensor on board: whether it is looked at, what it reads too much, where it is, and its noise.

    x, y: [m] ahead of the middle of the wheel axis and to the left of it.
    """

    used: bool
    range_bias: float
    bearing_bias: float
    x: float
    y: float
    sigma_range: float
    sigma_bearing: float


class NodeRules(NamedTuple):
    """All that is fixed about an estimator's node; ``times_at``: where an estimate's times stand."""

    step: Rules
    time: TimeRules
    sensor: SensorRules
    assumed: AssumedErrors
    times_at: int


class TimedFrame(NamedTuple):
    """A mocap frame, captured at a time by the host's clock."""

    capture_ns: int
    seen: PairSeen


class Notes(NamedTuple):
    """What a node remembers beside its tracks.

    ``receipts``: how many inputs have come since the last estimate. ``heard_ns``: when the newest one of all
    came. ``estimated_ns``: when the last estimate went out. ``verdict``, ``cause``: what became of the newest
    measurement, ``late`` whether it was captured before the newest.
    """

    times: HostTime
    receipts: int
    heard_ns: int
    estimated_ns: int
    verdict: int
    cause: int
    late: bool


NOTHING_NOTED = Notes(NO_TIME_YET, 0, 0, 0, 0, 0, False)


class Desk(NamedTuple):
    """Rows of a node: (1,) but for tracks, odometry, ways, clock, receipts, counts and bodies.

    ``frame``, ``sample``, ``sighting``: the newest input, read and checked. ``newest``: the last estimate.
    ``buffer``: its message. ``heads``, ``bodies``, ``wanted``: as a frame is read.
    """

    rules: Rows[NodeRules]
    points: Rows[TrackPoint]
    history: Rows[MotionSample]
    own: Rows[OwnPoint]
    ways: Rows[WayEntry]
    bank: Rows[Member]
    known: Rows[Known]
    time: TimeRows
    notes: Rows[Notes]
    receipts: Rows[Receipt]
    counts: Rows[Count]
    frame: Rows[TimedFrame]
    sample: Rows[OdometrySample]
    sighting: Rows[Sighting]
    newest: Rows[Estimate]
    buffer: Buffer
    heads: Rows[FrameHead]
    bodies: Rows[Body]
    wanted: Rows[Wanted]

    @kernel
    def memory(self) -> Memory:
        """Where the tracks lie."""
        return Memory(self.points, self.history, self.own, self.ways, self.bank)


@kernel
def noted(desk: Desk, digest: int, now_ns: int) -> bool:
    """Note an input's receipt; whether it came after the one before, or the clock was set back."""
    notes = load(Notes, desk.notes, 0)
    # Odometry without any frame must not fill the memory.
    count = with_receipt(desk.receipts, notes.receipts, digest, now_ns)
    store(desk.notes, 0, notes._replace(receipts=count, heard_ns=now_ns))
    return now_ns >= notes.heard_ns - CLOCK_TOLERANCE_NS


NOTHING_KNOWN = Known(
    track=EMPTY,
    odometry=EMPTY,
    own=EMPTY,
    correction=IDEAL,
    odometry_check=UNCHECKED,
    watched_ns=0,
    noise=NOISE_AS_TOLD,
    process=NOTHING_LEARNED,
    travel=NO_TRAVEL,
    mount_check=NO_MOUNT_CHECK,
    odometry_noise=ODOMETRY_AS_TOLD,
    slip=SLIP_AS_TOLD,
    answer=MotionSample(0, 0.0, 0.0),
)


@kernel
def forget(desk: Desk) -> None:
    """Know nothing any more of leader and follower."""
    store(desk.known, 0, NOTHING_KNOWN)


@kernel
def forget_tracks(desk: Desk) -> None:
    """Know nothing of where leader and follower are."""
    known = load(Known, desk.known, 0)
    # What was added up of the track does not hang together with what comes.
    check = without_track(known.odometry_check)
    noise = kept_noise(known.noise)
    store(desk.known, 0, known._replace(track=EMPTY, own=EMPTY, odometry_check=check, noise=noise))
