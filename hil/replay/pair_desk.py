"""What a replay of one follower works with: rows of its two nodes, and those in which results are kept."""

from __future__ import annotations

from typing import NamedTuple

from estimation.time.delay_line import Arrival
from estimation.time.host_time import HostTime, TimeRows
from formation.kernel import kernel
from formation.records import Buffer, Rows, load, size, store
from hil.nodes.controller_desk import Desk as ControllerDesk
from hil.nodes.estimator_desk import Desk as EstimatorDesk
from hil.replay.kept_rows import CommandRow, DriveRow, EstimateRow, MotionRow, PoseRow, TruthRow
from hil.replay.window import Number

DONE, WAITS, BEGINS, DIFFERS, ROOM, ODD = range(6)
"""Why steps end: all that there is was done; an output waits for inputs that may still come; a node is to
begin; an output does not come out again; there is no room to keep more; something only Python can read."""

PATIENCE_NS = 2_000_000_000
"""For how long in log time an output waits for an input that was logged after it."""

NEVER = -1


class Roles(NamedTuple):
    """Numbers of the topics of a pair, NOT_WANTED for what it does not have; ``stamped``: drive commands are.

    ``compares``: whether outputs are compared with what was logged. ``decides``: whether the controller is
    repeated too. ``tracks``: whether the follower's own track and odometry are kept.
    """

    frame: int
    odometry: int
    sighting: int
    estimate: int
    command: int
    drive: int
    leader_drive: int
    side: int
    stop: int
    truth: int
    stamped: bool
    compares: bool
    decides: bool
    tracks: bool


class Repeats(NamedTuple):
    """How far the outputs of a node are repeated.

    ``next``: number of the message in the window that is looked at next. ``outputs``: how many outputs were
    repeated. ``kept``: rows of what came out. ``missing``: inputs that were not there. ``begun``: whether
    the node was; ``begin_ns``: when it did anything first. ``logged_ns``, ``computed_ns``: when the last
    repeated output was logged, and made; ``before_ns``: when the one before that was. ``kept_before``,
    ``missing_before``, ``sent_before``: what there was before it, to repeat it otherwise.
    """

    next: int
    outputs: int
    kept: int
    missing: int
    begun: bool
    begin_ns: int
    logged_ns: int
    computed_ns: int
    before_ns: int
    kept_before: int
    missing_before: int
    sent_before: int


class Tallies(NamedTuple):
    """How many rows are kept of what was logged; ``next``: of the message to be looked at next.

    ``stopped_ns``: when the first stop was logged, NEVER for none. ``lost``: digests of missing inputs.
    ``arrivals``: frames that the estimator took in, of those that have left the window.
    """

    next: int
    truths: int
    poses: int
    motions: int
    sent: int
    driven: int
    lost: int
    arrivals: int
    stopped_ns: int


class Lengths(NamedTuple):
    """Bytes of the packed texts of a pair, and of a drive command."""

    names: int
    reasons: int
    stops: int
    sides: int
    drive: int


class Pair(NamedTuple):
    """Rows of a follower's replay.

    ``names``, ``reasons``, ``stops``, ``sides``: packed texts. ``received``: by the message's number in the
    window when the estimator took a frame in, 0 for never.
    """

    roles: Rows[Roles]
    estimator: EstimatorDesk
    names: Buffer
    reasons: Buffer
    controller: ControllerDesk
    stops: Buffer
    sides: Buffer
    estimating: Rows[Repeats]
    deciding: Rows[Repeats]
    tallies: Rows[Tallies]
    estimates: Rows[EstimateRow]
    commands: Rows[CommandRow]
    truths: Rows[TruthRow]
    poses: Rows[PoseRow]
    motions: Rows[MotionRow]
    sent: Rows[DriveRow]
    driven: Rows[DriveRow]
    lost: Rows[Number]
    arrivals: Rows[Arrival]
    received: Rows[Number]
    time: TimeRows
    times: Rows[HostTime]
    scratch: Buffer
    lengths: Rows[Lengths]


@kernel
def lost(pair: Pair, digest: int) -> None:
    """Keep the digest of an input that is missing, for as many as there is room."""
    tallies = load(Tallies, pair.tallies, 0)
    if tallies.lost < size(pair.lost):
        store(pair.lost, tallies.lost, Number(digest))
    store(pair.tallies, 0, tallies._replace(lost=tallies.lost + 1))
