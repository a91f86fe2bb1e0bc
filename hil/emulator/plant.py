"""The emulated lab of a scenario: memory of its world, and the random numbers that the world uses up."""

from __future__ import annotations

from typing import Any

import numpy as np

from formation.angles import FloatArray
from formation.leader import encoded
from formation.mount import Mount
from formation.pose import Motion, Pose
from formation.records import Rows, columns_of, load, row_of, rows_of, store
from formation.ring import EMPTY, place
from hil.emulator.entries import advance_world, command_robot, halt_robots
from hil.emulator.faults import fault_rows
from hil.emulator.mocap import (
    BodyNormals,
    CaptureClock,
    Delivery,
    MocapNoise,
    SeenPose,
    Shares,
    Stream,
    block_length,
    draw_into,
)
from hil.emulator.odometry_faults import Reckoning, odometry_fault_rows
from hil.emulator.robot import Actuators, Robot, standing
from hil.emulator.world import (
    NO_NUMBERS,
    NO_ROOM,
    Happened,
    Lab,
    Memory,
    Odometry,
    OdometryError,
    Underway,
    World,
)
from hil.scenario.parts import leader_program
from hil.scenario.schema import Scenario
from hil.wire.drive_message import drive_type
from hil.wire.messages import MalformedPayloadError, in_little_endian
from hil.wire.topics import topics_of

_ROOM = 16


def lab_of(scenario: Scenario) -> Lab:
    """All that is fixed in a scenario's lab, the leader's table and the faults apart."""
    robot, mocap = scenario.robot, scenario.mocap
    return Lab(
        Actuators(robot.lag_s, robot.v_max, robot.u_max, robot.v_resolution, robot.u_resolution),
        encoded(leader_program(scenario))[0],
        MocapNoise(mocap.sigma_position, mocap.sigma_heading, mocap.static_fraction),
        Delivery(mocap.latency_s, mocap.jitter_s, mocap.loss),
        CaptureClock(
            mocap.clock_offset_s, mocap.clock_drift_ppm * 1e-6, mocap.clock_jump_s, mocap.clock_jump_at_s
        ),
        OdometryError(
            robot.odometry_scale_v,
            robot.odometry_scale_u,
            robot.odometry_sigma_v,
            robot.odometry_sigma_u,
            robot.odometry_delay_s,
        ),
        mocap.rate_hz,
        robot.odometry_rate_hz,
        Mount(*map(float, mocap.leader_mount)),
        Mount(*map(float, mocap.follower_mount)),
    )


def world_at(begun_ns: int) -> World:
    """A world in which nothing has happened yet, without random numbers."""
    return World(
        begun_ns=begun_ns,
        time_ns=begun_ns,
        capture_due_ns=begun_ns,
        sample_due_ns=begun_ns,
        motion_since_ns=-1,
        frames=0,
        samples=0,
        frames_drawn=0,
        samples_drawn=0,
        lost=0,
        ready=False,
        stopped=False,
        shown=False,
        underway=EMPTY,
    )


def memory_of(scenario: Scenario, poses: tuple[Pose, ...], room: int = _ROOM) -> Memory:
    """Rows for robots that stand at these poses.

    ``room``: how much may be on its way at once, a power of two. Random numbers: those of one block.
    """
    robots, frames = len(poses), block_length(Stream.MOCAP)
    samples = block_length(Stream.LEADER_ODOMETRY)
    memory = Memory(
        rows_of(Robot, robots),
        encoded(leader_program(scenario))[1],
        fault_rows(scenario.mocap.faults),
        rows_of(BodyNormals, frames * robots),
        rows_of(Shares, frames),
        rows_of(Motion, samples * robots),
        rows_of(Underway, room),
        rows_of(Pose, robots),
        rows_of(SeenPose, room * robots),
        rows_of(Odometry, room * robots),
        odometry_fault_rows(scenario.robot.odometry_faults),
        rows_of(Reckoning, robots),
    )
    for k, pose in enumerate(poses):
        store(memory.robots, k, standing(pose))
        store(memory.reckoned, k, Reckoning(pose, pose))
    columns_of(memory.underway)["slot"] = np.arange(room)
    return memory


class Plant:
    """The lab of one run from ``begun_ns`` on: robots at their start poses, the leader first.

    It changes in place. ``memory``: see :class:`Memory`.
    """

    def __init__(self, scenario: Scenario, poses: tuple[Pose, ...], begun_ns: int) -> None:
        self._seed, self._robots = scenario.run.seed, len(poses)
        self._lab, self._world = row_of(lab_of(scenario)), row_of(world_at(begun_ns))
        self._now = columns_of(self._world)
        self._stamped = topics_of(scenario).stamped
        self._drive_type = drive_type(stamped=self._stamped)
        self.memory = memory_of(scenario, poses)
        self._leader_goal = columns_of(self.memory.robots)["goal"][0]

    def advance(self, until_ns: int) -> Happened:
        """Let the next thing happen that is due until a time."""
        while True:
            happened = advance_world(self._world, self._lab, *self.memory, until_ns)
            if happened.kind == NO_NUMBERS:
                self._draw()
            elif happened.kind == NO_ROOM:
                self._make_room()
            else:
                return happened

    def command(self, k: int, payload: bytes, now_ns: int) -> None:
        """Give the k-th robot a drive command now; once all are stopped, whatever it says, to stand still.

        Raises :class:`~hil.wire.messages.MalformedPayloadError` for a payload that is none.
        """
        whole = in_little_endian(payload, self._drive_type)
        robots, stamped = self.memory.robots, self._stamped
        if not command_robot(self._world, self._lab, robots, k, whole, stamped, now_ns):
            raise MalformedPayloadError(f"{len(payload)} bytes, expected a {self._drive_type}")

    def halt(self, now_ns: int) -> None:
        """Stop all robots now, for good."""
        halt_robots(self._world, self._lab, self.memory.robots, now_ns)

    def let_go(self) -> None:
        """Let the leader set off with the next frame."""
        self._now["ready"] = True

    @property
    def motion_since_ns(self) -> int:
        """When the leader set off, -1 before."""
        since_ns: int = self._now["motion_since_ns"].item()
        return since_ns

    @property
    def stopped(self) -> bool:
        """Whether the robots were stopped for good."""
        stopped: bool = self._now["stopped"].item()
        return stopped

    @property
    def leader_goal(self) -> Motion:
        """What the leader is told to drive."""
        return Motion(*self._leader_goal.item())

    def world(self) -> World:
        """The world as it is now."""
        return load(World, self._world, 0)

    def robot(self, k: int) -> Robot:
        """The k-th robot as it is now, the leader being the 0th."""
        return load(Robot, self.memory.robots, k)

    def robots(self) -> tuple[Robot, ...]:
        """All robots as they are now."""
        return tuple(self.robot(k) for k in range(self._robots))

    def _draw(self) -> None:
        """Draw the next block of frames or samples, whichever has run out."""
        world, memory = self.world(), self.memory
        if world.frames == world.frames_drawn:
            block, length = divmod(world.frames, block_length(Stream.MOCAP))[0], block_length(Stream.MOCAP)
            draw_into(_numbers(memory.normals), _numbers(memory.shares), self._seed, Stream.MOCAP, block)
            self._now["frames_drawn"] = world.frames + length
        if world.samples == world.samples_drawn:
            length = block_length(Stream.LEADER_ODOMETRY)
            block, nothing = world.samples // length, np.empty(0)
            numbers = _numbers(memory.odometry_normals).reshape(self._robots, -1)
            for stream, normal in enumerate(numbers, start=Stream.LEADER_ODOMETRY):
                draw_into(normal, nothing, self._seed, stream, block)
            self._now["samples_drawn"] = world.samples + length

    def _make_room(self) -> None:
        """Twice the room for what is on its way."""
        world, memory, n = self.world(), self.memory, self._robots
        room = len(memory.underway)
        underway = rows_of(Underway, 2 * room)
        columns_of(underway)["slot"] = np.arange(2 * room)
        for k in range(room):
            store(underway, k, load(Underway, memory.underway, place(world.underway, memory.underway, k)))
        seen, odometry = rows_of(SeenPose, 2 * room * n), rows_of(Odometry, 2 * room * n)
        columns_of(seen)[: room * n] = columns_of(memory.seen)
        columns_of(odometry)[: room * n] = columns_of(memory.odometry)
        self.memory = memory._replace(underway=underway, seen=seen, odometry=odometry)
        self._now["underway"]["first"] = 0


def _numbers(rows: Rows[Any]) -> FloatArray:
    """Rows of floats as one flat array."""
    return columns_of(rows).view(np.float64)
