"""Where the emulator enters compiled code."""

from __future__ import annotations

from formation.kernel import entry, kernel
from formation.leader import TableRow
from formation.pose import Motion, Pose
from formation.records import Buffer, Indices, Rows, borrowed, load, store
from hil.emulator.faults import Fault
from hil.emulator.mocap import BodyNormals, SeenPose, Shares
from hil.emulator.odometry_faults import OdometryFault, Reckoning
from hil.emulator.robot import Robot, pose_of, travelling
from hil.emulator.world import (
    Happened,
    Lab,
    Memory,
    Odometry,
    Underway,
    World,
    advanced,
    commanded,
    halted,
)
from hil.wire.cdr import write_placement
from hil.wire.command_layout import write_truth
from hil.wire.drive_layout import read_drive
from hil.wire.frame_layout import write_frame_head
from hil.wire.odometry_layout import write_odometry
from hil.wire.records import Odometry as OdometryNumbers
from hil.wire.records import Placement, TruthNumbers, stamp_of


@entry
def advance_world(
    world: Rows[World],
    lab: Rows[Lab],
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
    until_ns: int,
) -> Happened:
    """Let the next thing happen that is due until a time; the rows are those of :class:`Memory`."""
    memory = Memory(
        borrowed(robots),
        borrowed(table),
        borrowed(faults),
        borrowed(normals),
        borrowed(shares),
        borrowed(odometry_normals),
        borrowed(underway),
        borrowed(shown),
        borrowed(seen),
        borrowed(odometry),
        borrowed(odometry_faults),
        borrowed(reckoned),
    )
    step = advanced(load(World, world, 0), load(Lab, lab, 0), memory, until_ns)
    store(world, 0, step.world)
    return step.happened


@entry
def command_robot(
    worlds: Rows[World],
    labs: Rows[Lab],
    robots: Rows[Robot],
    k: int,
    payload: bytes,
    stamped: bool,
    now_ns: int,
) -> bool:
    """Give the k-th robot a drive command now, or once all are stopped to stand still; whether it is one."""
    world, drive = load(World, worlds, 0), read_drive(payload, stamped)
    wanted = Motion(drive.v, drive.u)
    if world.stopped:
        wanted = Motion(0.0, 0.0)
    elif not drive.sound:
        return False
    store(worlds, 0, commanded(world, load(Lab, labs, 0), borrowed(robots), k, wanted, now_ns))
    return True


@entry
def halt_robots(world: Rows[World], lab: Rows[Lab], robots: Rows[Robot], now_ns: int) -> None:
    """Stop all robots now, for good."""
    store(world, 0, halted(load(World, world, 0), load(Lab, lab, 0), borrowed(robots), now_ns))


@kernel
def _placed(seen: SeenPose) -> Placement:
    """A pose in space of what stands on the ground."""
    return Placement(seen.x, seen.y, 0.0, 0.0, 0.0, seen.qz, seen.qw)


@entry
def tell_frame(
    buffer: Buffer, places_at: Indices, stamp_ns: int, number: int, seen: Rows[SeenPose], first: int
) -> None:
    """Fill :func:`hil.wire.templates.frame_template` with the bodies in the rows from ``first`` on."""
    write_frame_head(buffer, places_at, stamp_ns, number)
    for k in range(len(places_at) - 1):
        write_placement(buffer, places_at[k + 1], _placed(load(SeenPose, borrowed(seen), first + k)))


@entry
def tell_odometry(buffer: Buffer, numbers_at: int, stamp_ns: int, odometry: Rows[Odometry], k: int) -> None:
    """Fill :func:`hil.wire.templates.odometry_template` with what a robot says of itself in the k-th row."""
    sample = load(Odometry, borrowed(odometry), k)
    message = OdometryNumbers(
        True, stamp_of(stamp_ns), _placed(sample.pose), sample.motion.v, sample.motion.u
    )
    write_odometry(buffer, numbers_at, stamp_ns, message)


@entry
def tell_truth(
    buffer: Buffer, number_at: int, stamp_ns: int, number: int, robots: Rows[Robot], k: int
) -> None:
    """Fill :func:`hil.wire.templates.truth_template` with the k-th robot, a leader, and the next."""
    leader, follower = load(Robot, borrowed(robots), k), load(Robot, borrowed(robots), k + 1)
    led, second = travelling(leader), pose_of(follower)
    numbers = TruthNumbers(
        stamp_ns,
        number,
        led.pose.x,
        led.pose.y,
        led.pose.theta,
        led.motion.v,
        led.motion.u,
        second.x,
        second.y,
        second.theta,
        follower.motion.v,
        follower.motion.u,
    )
    write_truth(buffer, number_at, numbers)
