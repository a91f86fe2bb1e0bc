"""The world by its kernels: compiled and as plain Python, and what is on its way."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.kernel import interpreted
from formation.pose import Motion, Pose
from formation.records import columns_of, load, row_of, rows_of, store
from formation.ring import Ring, place, without_oldest
from hil.emulator.entries import advance_world, command_robot, halt_robots
from hil.emulator.mocap import SeenPose
from hil.emulator.plant import Plant, lab_of, memory_of, world_at
from hil.emulator.world import (
    CAPTURE,
    FRAME,
    NO_NUMBERS,
    NO_ROOM,
    NOTHING,
    ODOMETRY,
    SAMPLE,
    Happened,
    Underway,
    World,
    sent_off,
)
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.scenario.start import chain_poses
from hil.wire.drive_message import drive_message
from hil.wire.messages import encode

EPOCH_NS = 1_767_225_600_000_000_000
MS = 1_000_000
SINUSOID = '{kind="sinusoid", v=0.1, u_mean=0.1, u_amplitude=0.4, omega=2.0}'
TABLE = '{kind="table", t=[0.0, 0.1, 0.3], v=[0.0, 0.1, 0.2], u=[0.1, -0.5, 0.5]}'
FAULTS = (
    'mocap.faults=[{kind="freeze", at_s=0.05, duration_s=0.05}, {kind="turn", at_s=0.1, body="both"},'
    ' {kind="swap", at_s=0.1, duration_s=0.03}, {kind="dropout", at_s=0.2, duration_s=0.02},'
    ' {kind="step", at_s=0.15, body="follower", duration_s=0.2}]'
)
LYING = (
    'robot.odometry_faults=[{kind="scale", at_s=0.05, duration_s=0.1}, {kind="slip", at_s=0.05},'
    ' {kind="reversed", at_s=0.1}, {kind="reset", at_s=0.15}, {kind="delay", at_s=0.2, delay_s=0.05},'
    ' {kind="commands", at_s=0.25}, {kind="zero", at_s=0.3}, {kind="nan", at_s=0.35},'
    ' {kind="silent", at_s=0.4}]'
)
LOOSE = ["mocap.jitter_s=0.02", "mocap.loss=0.2", "robot.odometry_delay_s=0.017", "mocap.clock_drift_ppm=300"]


def poses(scenario: Scenario) -> tuple[Pose, ...]:
    return chain_poses(scenario, 3)


class World3:
    """Rows of a world of three robots, and entries, compiled or not, that work in them."""

    def __init__(self, scenario: Scenario, *, compiled: bool) -> None:
        entries: list[Any] = [advance_world, command_robot, halt_robots]
        self.entries = entries if compiled else [interpreted(each) for each in entries]
        plant = Plant(scenario, poses(scenario), EPOCH_NS)
        plant.advance(EPOCH_NS)  # draws the first blocks of random numbers
        drawn = plant.memory
        self.memory = memory_of(scenario, poses(scenario), 64)._replace(
            normals=drawn.normals, shares=drawn.shares, odometry_normals=drawn.odometry_normals
        )
        world = world_at(EPOCH_NS)._replace(ready=True, frames_drawn=4096, samples_drawn=1024)
        self.world, self.lab = row_of(world), row_of(lab_of(scenario))

    def left_behind(self) -> list[bytes]:
        rows: list[Any] = [self.world, *self.memory]
        return [columns_of(each).tobytes() for each in rows]

    def run(self) -> list[Happened]:
        """Everything until 0.5 s, with commands and a stop in between."""
        advance, command, halt = self.entries
        happened: list[Happened] = []
        for k in range(50):
            now_ns = EPOCH_NS + k * 10 * MS
            while (last := advance(self.world, self.lab, *self.memory, now_ns)).kind != NOTHING:
                happened.append(last)
            wanted = Motion(0.01 * k, math.sin(k)) if k % 7 else Motion(math.nan, 0.0)
            payload = encode(drive_message(wanted, now_ns, "follower", stamped=True))
            rows = self.world, self.lab, self.memory.robots
            assert command(*rows, 1 + k % 2, payload, True, now_ns + 3 * MS)
            if k == 40:
                halt(self.world, self.lab, self.memory.robots, now_ns + 4 * MS)
        return happened


@pytest.mark.parametrize("program", [SINUSOID, TABLE])
def test_compiled_and_plain_give_the_same_bits(program: str) -> None:
    scenario = load_scenario("turtlebot3", [f"leader.program={program}", FAULTS, LYING, *LOOSE])
    fast, plain = (World3(scenario, compiled=compiled) for compiled in (True, False))
    happened = fast.run()
    assert happened == plain.run()
    assert {each.kind for each in happened} == {CAPTURE, SAMPLE, FRAME, ODOMETRY}
    assert fast.left_behind() == plain.left_behind()


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=8), st.integers(0, 7))
def test_what_is_on_its_way_arrives_by_time_then_number_then_order(
    keys: list[tuple[int, int]], first: int
) -> None:
    rows, ring = rows_of(Underway, 8), Ring(first, 0)
    columns_of(rows)["slot"] = range(8)
    for at_ns, (release_ns, number) in enumerate(keys):
        slot = load(Underway, rows, place(ring, rows, ring.length)).slot
        ring = sent_off(ring, rows, Underway(release_ns, number, FRAME, at_ns, 0, slot))
        assert sorted(columns_of(rows)["slot"].tolist()) == list(range(8))
    arrived = []
    for _ in keys:
        item = load(Underway, rows, place(ring, rows, 0))
        arrived.append((item.release_ns, item.number, item.at_ns))
        ring = without_oldest(ring, rows, 1)
    assert arrived == sorted((*key, at_ns) for at_ns, key in enumerate(keys))


def test_without_room_or_random_numbers_nothing_is_lost_but_said() -> None:
    scenario = load_scenario("turtlebot3", ["mocap.latency_s=10"])
    world, lab = row_of(world_at(0)), row_of(lab_of(scenario))
    memory = memory_of(scenario, poses(scenario), 4)
    before = columns_of(world).tobytes()
    assert advance_world(world, lab, *memory, 0).kind == NO_NUMBERS
    assert columns_of(world).tobytes() == before
    store(world, 0, world_at(0)._replace(frames_drawn=9, samples_drawn=9))
    kinds = [advance_world(world, lab, *memory, 100 * MS).kind for _ in range(20)]
    assert kinds.count(CAPTURE) == 4
    assert kinds[-1] == NO_ROOM
    assert load(World, world, 0).underway.length == 4


def shown(plant: Plant, slot: int) -> tuple[tuple[float, float], ...]:
    """Where the frame in a slot shows the robots."""
    robots = len(plant.memory.robots)
    seen = (load(SeenPose, plant.memory.seen, robots * slot + k) for k in range(robots))
    return tuple((pose.x, pose.y) for pose in seen)


@given(st.integers(0, 2**30))
@settings(deadline=None, max_examples=20)
def test_a_plant_makes_room_and_draws_on_and_frames_keep_their_contents(seed: int) -> None:
    given_ = [f"run.seed={seed}", "mocap.latency_s=0.2", "mocap.jitter_s=0.05", "mocap.rate_hz=1000"]
    scenario = load_scenario("turtlebot3", [*given_, "robot.odometry_rate_hz=1000", "mocap.sigma_position=1"])
    plant = Plant(scenario, poses(scenario), 0)
    arrived, captured = {}, 0
    while (happened := plant.advance(2000 * MS)).kind != NOTHING:
        captured += happened.kind == CAPTURE
        if happened.kind == FRAME:
            arrived[happened.number] = shown(plant, happened.slot)
    assert captured == 2001
    assert plant.world().samples == 2001
    assert len(set(arrived.values())) == len(arrived) == captured - plant.world().underway.length
    numbers = columns_of(plant.memory.normals)[["x", "y"]].reshape(-1, 3).tolist()
    for number, seen in arrived.items():
        for k, pose in enumerate(poses(scenario)):
            x, y = numbers[number][k]
            assert seen[k] == pytest.approx((pose.x + 0.05 * x, pose.y + 0.05 * y), abs=1e-12)
