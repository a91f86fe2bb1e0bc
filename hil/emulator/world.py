"""The world of a run: robots, motion capture and odometry, from one thing that happens to the next.

``World`` is what changes, ``Lab`` what is fixed, ``Memory`` the rows that both work in. The robots move from
one thing that matters to them to the next, so that it makes no difference how often anybody asks.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from formation.kernel import kernel
from formation.leader import Program, TableRow, driven
from formation.mount import Mount
from formation.pose import STANDSTILL, Motion, Pose
from formation.records import Rows, load, size, store
from formation.ring import Ring, place, without_oldest
from hil.emulator.faults import Fault, Pair, faulty
from hil.emulator.mocap import (
    BodyNormals,
    CaptureClock,
    Delivery,
    MocapNoise,
    SeenPose,
    Shares,
    observe,
    seen_pose,
    whole_ns,
)
from hil.emulator.odometry_faults import OdometryFault, OdometryTwist, Reckoning, faulty_twist, reckoned
from hil.emulator.robot import Actuators, Robot, arcs_of, drive, pose_of

_NS = 1e-9


class Happening(IntEnum):
    """What happened last; nothing was due, or there is no room or no random number for what is due."""

    NOTHING = 0
    CAPTURE = 1
    SAMPLE = 2
    FRAME = 3
    ODOMETRY = 4
    NO_ROOM = 5
    NO_NUMBERS = 6


NOTHING = Happening.NOTHING.value
CAPTURE = Happening.CAPTURE.value
SAMPLE = Happening.SAMPLE.value
FRAME = Happening.FRAME.value
ODOMETRY = Happening.ODOMETRY.value
NO_ROOM = Happening.NO_ROOM.value
NO_NUMBERS = Happening.NO_NUMBERS.value


class OdometryError(NamedTuple):
    """Odometry: scales, noise of a robot that moves [m/s], [rad/s], and how long it is on its way [s]."""

    scale_v: float
    scale_u: float
    sigma_v: float
    sigma_u: float
    delay: float


class Lab(NamedTuple):
    """All that is fixed. Rates are in Hz. Mounts: of the leader's body, and of every follower's."""

    actuators: Actuators
    program: Program
    noise: MocapNoise
    delivery: Delivery
    clock: CaptureClock
    odometry: OdometryError
    mocap_rate: float
    odometry_rate: float
    leader_mount: Mount
    follower_mount: Mount


class World(NamedTuple):
    """All that changes, besides what is in rows.

    ``capture_due_ns``, ``sample_due_ns``: when the next frame is captured and odometry sampled next.
    ``motion_since_ns``: when the leader set off, -1 before; ``ready``: it may set off with the next frame.
    ``frames``, ``samples``: how many captures and odometry samples there were; ``frames_drawn``,
    ``samples_drawn``: for how many there are random numbers. ``lost``: frames that never arrive. ``shown``: a
    frame has shown the bodies. ``underway``: ring of what is on its way.
    """

    begun_ns: int
    time_ns: int
    capture_due_ns: int
    sample_due_ns: int
    motion_since_ns: int
    frames: int
    samples: int
    frames_drawn: int
    samples_drawn: int
    lost: int
    ready: bool
    stopped: bool
    shown: bool
    underway: Ring


class Underway(NamedTuple):
    """A frame or an odometry sample on its way: FRAME or ODOMETRY, and where its contents lie.

    ``at_ns``: when it was captured; ``stamp_ns``: what it says of that.
    """

    release_ns: int
    number: int
    kind: int
    at_ns: int
    stamp_ns: int
    slot: int


NEVER = -1


class Odometry(NamedTuple):
    """What a robot says of itself; ``arrives_ns``: when it does, as it is stamped, NEVER for not at all."""

    pose: SeenPose
    motion: Motion
    arrives_ns: int


class Memory(NamedTuple):
    """Rows of the world. A row for each of n robots, the leader first: ``robots``, ``shown``.

    ``table``: of the leader's program. ``faults``: of the motion capture. Random numbers of the last items
    drawn, item k in row k modulo their number: ``normals`` n rows for each frame, ``shares`` one;
    ``odometry_normals`` as many for each robot, robot by robot. ``underway``: sorted by release time, then
    number; in the rows beyond the ring are free slots. A slot has n rows in ``seen`` and ``odometry``.
    ``shown``: what the newest frame shows. ``odometry_faults``: of all robots but the leader.
    ``reckoned``: of each robot.
    """

    robots: Rows[Robot]
    table: Rows[TableRow]
    faults: Rows[Fault]
    normals: Rows[BodyNormals]
    shares: Rows[Shares]
    odometry_normals: Rows[Motion]
    underway: Rows[Underway]
    shown: Rows[Pose]
    seen: Rows[SeenPose]
    odometry: Rows[Odometry]
    odometry_faults: Rows[OdometryFault]
    reckoned: Rows[Reckoning]


class Happened(NamedTuple):
    """One thing that happened, by a value of :class:`Happening`; ``due_ns``: when the next will.

    ``number``, ``at_ns``, ``stamp_ns``, ``slot``: of the capture or sample, or of what arrives.
    """

    kind: int
    number: int
    at_ns: int
    stamp_ns: int
    slot: int
    due_ns: int


class Step(NamedTuple):
    """The world after something happened."""

    world: World
    happened: Happened


@kernel
def due_ns(world: World, memory: Memory) -> int:
    """When something happens next."""
    due = min(world.capture_due_ns, world.sample_due_ns)
    if world.underway.length == 0:
        return due
    return min(due, load(Underway, memory.underway, place(world.underway, memory.underway, 0)).release_ns)


@kernel
def moved(world: World, lab: Lab, robots: Rows[Robot], until_ns: int) -> World:
    """World at a later time; all robots drive until then."""
    if until_ns <= world.time_ns:
        return world
    arcs = arcs_of((until_ns - world.time_ns) * _NS, lab.actuators.lag)
    for k in range(size(robots)):
        store(robots, k, drive(load(Robot, robots, k), arcs))
    return world._replace(time_ns=until_ns)


@kernel
def commanded(world: World, lab: Lab, robots: Rows[Robot], k: int, wanted: Motion, now_ns: int) -> World:
    """World in which the k-th robot has got a command now; none moves one any more after a stop."""
    world = moved(world, lab, robots, now_ns)
    goal = Motion(0.0, 0.0) if world.stopped else lab.actuators.accept(wanted)
    store(robots, k, load(Robot, robots, k)._replace(goal=goal))
    return world


@kernel
def halted(world: World, lab: Lab, robots: Rows[Robot], now_ns: int) -> World:
    """World in which all robots have been told to stop now, for good."""
    world = moved(world, lab, robots, now_ns)
    for k in range(size(robots)):
        store(robots, k, load(Robot, robots, k)._replace(goal=Motion(0.0, 0.0)))
    return world._replace(stopped=True)


@kernel
def advanced(world: World, lab: Lab, memory: Memory, until_ns: int) -> Step:
    """World after the next thing that happens until a time: arrivals first, then odometry, then a capture."""
    now_ns = due_ns(world, memory)
    if now_ns > until_ns:
        return Step(world, Happened(NOTHING, 0, 0, 0, 0, now_ns))
    ring = world.underway
    if ring.length > 0:
        first = load(Underway, memory.underway, place(ring, memory.underway, 0))
        if first.release_ns == now_ns:
            world = world._replace(underway=without_oldest(ring, memory.underway, 1))
            due = due_ns(world, memory)
            happened = Happened(first.kind, first.number, first.at_ns, first.stamp_ns, first.slot, due)
            return Step(world, happened)
    if ring.length == size(memory.underway):
        return Step(world, Happened(NO_ROOM, 0, 0, 0, 0, now_ns))
    slot = load(Underway, memory.underway, place(ring, memory.underway, ring.length)).slot
    if world.sample_due_ns == now_ns:
        number, kind, drawn = world.samples, SAMPLE, world.samples_drawn
    else:
        number, kind, drawn = world.frames, CAPTURE, world.frames_drawn
    if number >= drawn:
        return Step(world, Happened(NO_NUMBERS, 0, 0, 0, 0, now_ns))
    world = moved(world, lab, memory.robots, now_ns)
    world = sampled(world, lab, memory, slot) if kind == SAMPLE else captured(world, lab, memory, slot)
    due = due_ns(world, memory)
    return Step(world, Happened(kind, number, now_ns, now_ns, slot, due))


@kernel(inline=False)
def captured(world: World, lab: Lab, memory: Memory, slot: int) -> World:
    """World after a capture now: the leader's program goes on, and a frame is on its way, or lost."""
    at_ns, number = world.time_ns, world.frames
    next_ns = world.begun_ns + whole_ns((number + 1) / lab.mocap_rate)
    world = _led(world, lab, memory)._replace(frames=number + 1, capture_due_ns=next_ns)
    shares = load(Shares, memory.shares, number % size(memory.shares))
    if lab.delivery.loses(shares) or not _shown(world, lab, memory, number):
        return world._replace(lost=world.lost + 1)
    robots = size(memory.robots)
    for k in range(robots):
        store(memory.seen, slot * robots + k, seen_pose(load(Pose, memory.shown, k)))
    stamp_ns = lab.clock.reading_ns(at_ns, world.begun_ns, world.motion_since_ns)
    release_ns = at_ns + whole_ns(lab.delivery.time_on_the_way(shares))
    item = Underway(release_ns, number, FRAME, at_ns, stamp_ns, slot)
    return world._replace(shown=True, underway=sent_off(world.underway, memory.underway, item))


@kernel(inline=False)
def sampled(world: World, lab: Lab, memory: Memory, slot: int) -> World:
    """World after all robots' odometry was sampled now; with a delay it is on its way, else in its slot."""
    at_ns, number, error = world.time_ns, world.samples, lab.odometry
    robots = size(memory.robots)
    items = size(memory.odometry_normals) // robots
    delay, t = error.delay, -1.0
    if size(memory.odometry_faults) > 0 and world.motion_since_ns >= 0:
        t = (at_ns - world.motion_since_ns) * _NS
        delay = delay + _told(memory, lab, load(Robot, memory.robots, 0), STANDSTILL, t).delay
    arrives_ns = at_ns + whole_ns(delay)
    for k in range(robots):
        robot = load(Robot, memory.robots, k)
        normal = load(Motion, memory.odometry_normals, k * items + number % items)
        moving = 0.0 if robot.stands() else 1.0
        measured = Motion(
            error.scale_v * robot.motion.v + moving * error.sigma_v * normal.v,
            error.scale_u * robot.motion.u + moving * error.sigma_u * normal.u,
        )
        # Faults are those of followers: nobody drives by the leader's odometry.
        told = _told(memory, lab, robot, measured, t if k > 0 else -1.0)
        wheels = Motion(error.scale_v * told.wheels.v, error.scale_u * told.wheels.u)
        last = load(Reckoning, memory.reckoned, k)
        here = reckoned(last, pose_of(robot), wheels, told.resets)
        store(memory.reckoned, k, here)
        sample = Odometry(seen_pose(here.told), told.told, NEVER if told.silent else arrives_ns)
        store(memory.odometry, slot * robots + k, sample)
    next_ns = world.begun_ns + whole_ns((number + 1) / lab.odometry_rate)
    world = world._replace(samples=number + 1, sample_due_ns=next_ns)
    if arrives_ns == at_ns:
        return world
    item = Underway(arrives_ns, number, ODOMETRY, at_ns, arrives_ns, slot)
    return world._replace(underway=sent_off(world.underway, memory.underway, item))


@kernel
def _told(memory: Memory, lab: Lab, robot: Robot, measured: Motion, t: float) -> OdometryTwist:
    """What becomes of a robot's measured motion t [s] after the leader set off; all is well before."""
    if t < 0.0:
        return OdometryTwist(measured, Motion(1.0, 1.0), False, False, 0.0)
    period = 1.0 / lab.odometry_rate
    return faulty_twist(memory.odometry_faults, t, period, robot.motion, measured, robot.goal)


@kernel
def sent_off(ring: Ring, underway: Rows[Underway], item: Underway) -> Ring:
    """Ring with one more item, behind those that arrive before it or have the same time and number."""
    k = ring.length
    while k > 0:
        before = load(Underway, underway, place(ring, underway, k - 1))
        if before.release_ns < item.release_ns:
            break
        if before.release_ns == item.release_ns and before.number <= item.number:
            break
        store(underway, place(ring, underway, k), before)
        k -= 1
    store(underway, place(ring, underway, k), item)
    return Ring(ring.first, ring.length + 1)


@kernel
def _led(world: World, lab: Lab, memory: Memory) -> World:
    """Give the leader its next command; it sets off once all are ready."""
    if world.stopped or (world.motion_since_ns < 0 and not world.ready):
        return world
    if world.motion_since_ns < 0:
        world = world._replace(motion_since_ns=world.time_ns)
    wanted = driven(lab.program, memory.table, (world.time_ns - world.motion_since_ns) * _NS)
    leader = load(Robot, memory.robots, 0)
    store(memory.robots, 0, leader._replace(goal=lab.actuators.accept(wanted)))
    return world


@kernel
def _shown(world: World, lab: Lab, memory: Memory, number: int) -> bool:
    """Put into ``shown`` what the motion capture shows now, faults included; False for no frame at all."""
    last = Pair(load(Pose, memory.shown, 0), load(Pose, memory.shown, 1))
    for k in range(size(memory.robots)):
        store(memory.shown, k, _observed(memory, lab, number, k))
    if size(memory.faults) == 0 or world.motion_since_ns < 0:
        return True
    t = (world.time_ns - world.motion_since_ns) * _NS
    pair = Pair(load(Pose, memory.shown, 0), load(Pose, memory.shown, 1))
    shown = faulty(memory.faults, t, 1.0 / lab.mocap_rate, pair, last if world.shown else pair)
    pair = last if shown.lost else shown.pair
    store(memory.shown, 0, pair.leader)
    store(memory.shown, 1, pair.follower)
    return not shown.lost


@kernel
def _observed(memory: Memory, lab: Lab, number: int, k: int) -> Pose:
    robots, mount = size(memory.robots), lab.follower_mount if k > 0 else lab.leader_mount
    row = (number % size(memory.shares)) * robots + k
    return observe(load(Robot, memory.robots, k), lab.noise, load(BodyNormals, memory.normals, row), mount)
