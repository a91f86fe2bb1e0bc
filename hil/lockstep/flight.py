"""What a run in the compiled loop is made of: its plan, its followers, and what it leaves behind."""

from __future__ import annotations

from typing import NamedTuple

from controllers.follower import Command
from estimation.consistency.filter_bank import Member
from estimation.consistency.slip_estimate import BANK
from estimation.own_motion.odometry_check import WayEntry
from estimation.own_motion.odometry_history import MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.estimate import Estimate
from estimation.tracking.prediction import SentCommand
from estimation.tracking.track_point import TrackPoint
from formation.kernel import kernel
from formation.pose import Motion, Pose
from formation.records import Rows, part
from hil.emulator.world import Lab, Memory, World
from hil.nodes.controller_step import ControlRules, ControlState
from hil.nodes.estimator_records import Known, Rules
from hil.nodes.estimator_records import Memory as Tracks

RUNNING, LANDED, STUCK, SHORT_OF_ROOM, SHORT_OF_NUMBERS = 0, 1, 2, 3, 4
"""Where a run stands: under way, over, its barrier closed for too long, and what it lacks to go on."""


class Share(NamedTuple):
    """Rows of each kind that one follower has."""

    points: int
    history: int
    own: int
    ways: int
    sent: int


class Plan(NamedTuple):
    """All that is fixed in a run besides the rules of each follower.

    Times are on the simulated clock, which begins at ``world.begun_ns``. patience_ns: until when the leader
    must have set off. duration_ns: from then to the stop. after_ns: how long the run goes on from there.
    judged_from_ns: from when on after the leader's start estimates are kept, -1 for all of them.
    offset_ns: what is taken off the stamps of frames. share: of the rows for each follower.
    """

    lab: Lab
    patience_ns: int
    duration_ns: int
    after_ns: int
    judged_from_ns: int
    offset_ns: int
    share: Share


class Clock(NamedTuple):
    """What one follower's daemons owe to the clock, and what they have said.

    tick_ns: of its estimator; report_ns, control_report_ns: when estimator and controller report next;
    published_ns: of the last estimate, -1 before. estimator_well, controller_well: whether they have said so;
    commanded: whether its robot has had a command.
    """

    tick_ns: int
    report_ns: int
    control_report_ns: int
    published_ns: int
    estimator_well: bool
    controller_well: bool
    commanded: bool


class Order(NamedTuple):
    """An order to drive on a side, at so many seconds after the leader's start; the sign is the side's."""

    at: float
    sign: float


class Flight(NamedTuple):
    """How far a run has come: where it stands, until when it goes on, and how much it has left behind."""

    stage: int
    world: World
    end_ns: int
    orders: int
    captures: int
    estimates: int
    commands: int


class TrueFrame(NamedTuple):
    """The truth behind a capture of one pair; ``arrives``: whether its frame is not lost."""

    at_ns: int
    arrives: bool
    leader: Pose
    follower: Pose
    leader_motion: Motion
    follower_motion: Motion


class KeptEstimate(NamedTuple):
    """An estimate that was made, when and by which follower."""

    follower: int
    now_ns: int
    estimate: Estimate


class KeptCommand(NamedTuple):
    """A command that was sent, when and by which follower."""

    follower: int
    now_ns: int
    command: Command


class Rooms(NamedTuple):
    """Rows of a run: the lab's, each follower's one after the other, and what is left behind.

    ``waiting``: followers whose estimate is on its way to their controller.
    """

    lab: Memory
    clocks: Rows[Clock]
    knowns: Rows[Known]
    controls: Rows[ControlState]
    rules: Rows[Rules]
    control_rules: Rows[ControlRules]
    points: Rows[TrackPoint]
    history: Rows[MotionSample]
    own: Rows[OwnPoint]
    ways: Rows[WayEntry]
    bank: Rows[Member]
    sent: Rows[SentCommand]
    orders: Rows[Order]
    waiting: Rows[KeptEstimate]
    truth: Rows[TrueFrame]
    estimates: Rows[KeptEstimate]
    commands: Rows[KeptCommand]


@kernel
def tracks_of(rooms: Rooms, share: Share, k: int) -> Tracks:
    """Rows of the k-th follower's estimator."""
    return Tracks(
        part(TrackPoint, rooms.points, k * share.points, share.points),
        part(MotionSample, rooms.history, k * share.history, share.history),
        part(OwnPoint, rooms.own, k * share.own, share.own),
        part(WayEntry, rooms.ways, k * share.ways, share.ways),
        part(Member, rooms.bank, k * BANK, BANK),
    )


@kernel
def sent_of(rooms: Rooms, share: Share, k: int) -> Rows[SentCommand]:
    """Rows of the commands that the k-th follower's controller has on their way."""
    return part(SentCommand, rooms.sent, k * share.sent, share.sent)
