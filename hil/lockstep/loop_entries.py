"""The closed loop, compiled: Python enters once for a whole run."""

from __future__ import annotations

from estimation.consistency.filter_bank import Member
from estimation.own_motion.odometry_check import WayEntry
from estimation.own_motion.odometry_history import MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.prediction import SentCommand
from estimation.tracking.track_point import TrackPoint
from formation.kernel import entry
from formation.leader import TableRow
from formation.pose import Motion, Pose
from formation.records import Rows, borrowed, load, store
from hil.emulator.faults import Fault
from hil.emulator.mocap import BodyNormals, SeenPose, Shares
from hil.emulator.odometry_faults import OdometryFault, Reckoning
from hil.emulator.robot import Robot
from hil.emulator.world import Memory, Odometry, Underway
from hil.lockstep.flight import (
    Clock,
    Flight,
    KeptCommand,
    KeptEstimate,
    Order,
    Plan,
    Rooms,
    TrueFrame,
)
from hil.lockstep.loop import flown
from hil.nodes.controller_step import ControlRules, ControlState
from hil.nodes.estimator_records import Known, Rules


@entry
def fly(
    flights: Rows[Flight],
    plans: Rows[Plan],
    robots: Rows[Robot],
    table: Rows[TableRow],
    faults: Rows[Fault],
    normals: Rows[BodyNormals],
    shares: Rows[Shares],
    odometry_normals: Rows[Motion],
    underway: Rows[Underway],
    shown: Rows[Pose],
    seen: Rows[SeenPose],
    odometry: Rows[Odometry],
    odometry_faults: Rows[OdometryFault],
    reckoned: Rows[Reckoning],
    clocks: Rows[Clock],
    knowns: Rows[Known],
    controls: Rows[ControlState],
    rules: Rows[Rules],
    control_rules: Rows[ControlRules],
    points: Rows[TrackPoint],
    history: Rows[MotionSample],
    own: Rows[OwnPoint],
    ways: Rows[WayEntry],
    bank: Rows[Member],
    sent: Rows[SentCommand],
    orders: Rows[Order],
    waiting: Rows[KeptEstimate],
    truth: Rows[TrueFrame],
    estimates: Rows[KeptEstimate],
    commands: Rows[KeptCommand],
) -> int:
    """Fly on; the stage that the flight has come to. The rows are those of :class:`Rooms`, the lab first."""
    lab = Memory(
        borrowed(robots), borrowed(table), borrowed(faults), borrowed(normals), borrowed(shares),
        borrowed(odometry_normals), borrowed(underway), borrowed(shown), borrowed(seen), borrowed(odometry),
        borrowed(odometry_faults), borrowed(reckoned),
    )  # fmt: skip
    rooms = Rooms(
        lab, borrowed(clocks), borrowed(knowns), borrowed(controls), borrowed(rules),
        borrowed(control_rules), borrowed(points), borrowed(history), borrowed(own), borrowed(ways),
        borrowed(bank), borrowed(sent), borrowed(orders), borrowed(waiting), borrowed(truth),
        borrowed(estimates), borrowed(commands),
    )  # fmt: skip
    flight = flown(load(Flight, flights, 0), load(Plan, plans, 0), rooms)
    store(flights, 0, flight)
    return flight.stage
