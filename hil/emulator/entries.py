"""Where the emulator enters compiled code."""

from __future__ import annotations

from formation.kernel import entry
from formation.leader import TableRow
from formation.pose import Motion, Pose
from formation.records import Rows, borrowed, load, store
from hil.emulator.faults import Fault
from hil.emulator.mocap import BodyNormals, SeenPose, Shares
from hil.emulator.robot import Robot
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
    )
    step = advanced(load(World, world, 0), load(Lab, lab, 0), memory, until_ns)
    store(world, 0, step.world)
    return step.happened


@entry
def command_robot(
    world: Rows[World], lab: Rows[Lab], robots: Rows[Robot], k: int, wanted: Motion, now_ns: int
) -> None:
    """Give the k-th robot a command now."""
    store(world, 0, commanded(load(World, world, 0), load(Lab, lab, 0), borrowed(robots), k, wanted, now_ns))


@entry
def halt_robots(world: Rows[World], lab: Rows[Lab], robots: Rows[Robot], now_ns: int) -> None:
    """Stop all robots now, for good."""
    store(world, 0, halted(load(World, world, 0), load(Lab, lab, 0), borrowed(robots), now_ns))
