"""Faults of the emulated odometry: each does what its name says, to followers only."""

from __future__ import annotations

import math
from typing import NamedTuple, get_args, get_type_hints

import pytest

from formation.pose import Motion, Pose, advance
from formation.records import columns_of, load
from hil.emulator.odometry_faults import (
    NAN,
    OdometryFaultKind,
    Reckoning,
    faulty_twist,
    odometry_fault_rows,
    reckoned,
)
from hil.emulator.plant import Plant
from hil.emulator.world import NOTHING, ODOMETRY, SAMPLE, Odometry
from hil.scenario.emulated import OdometryFaultSection
from hil.scenario.files import load_scenario
from hil.scenario.start import chain_poses

EPOCH_NS = 1_767_225_600_000_000_000
MOVES, TOLD, WANTED = Motion(0.1, 0.5), Motion(0.11, 0.52), Motion(0.15, -0.4)
PERIOD = 1.0 / 30.0


def section(kind: str, **given: float) -> OdometryFaultSection:
    return OdometryFaultSection(kind=kind, at_s=2.0, **given)  # type: ignore[arg-type]


def test_the_words_of_scenarios_are_the_kinds() -> None:
    words = get_args(get_type_hints(OdometryFaultSection)["kind"])
    assert list(words) == [kind.name.lower() for kind in OdometryFaultKind]


@pytest.mark.parametrize(
    ("fault", "v", "u"),
    [
        (section("zero"), 0.0, 0.0),
        (section("reversed"), -TOLD.v, -TOLD.u),
        (section("scale", factor=1.3), 1.3 * TOLD.v, 1.3 * TOLD.u),
        (section("slip", factor=0.4), TOLD.v / 0.8, TOLD.u / 0.8),
        (section("delay"), TOLD.v, TOLD.u),
        (section("reset"), TOLD.v, TOLD.u),
        (section("commands"), WANTED.v, WANTED.u),
    ],
)
def test_each_fault_tells_what_its_name_says(fault: OdometryFaultSection, v: float, u: float) -> None:
    rows = odometry_fault_rows([fault])
    before = faulty_twist(rows, 1.99, PERIOD, MOVES, TOLD, WANTED)
    assert before == (TOLD, Motion(1.0, 1.0), False, False, 0.0)
    told = faulty_twist(rows, 2.0, PERIOD, MOVES, TOLD, WANTED)
    assert told.told == pytest.approx(Motion(v, u))
    assert told.delay == (0.2 if fault.kind == "delay" else 0.0)
    assert told.resets is (fault.kind == "reset")
    assert not told.silent
    # A pose adds up what the wheels do, and no wheel does what an empty twist tells, or a wanted one.
    by_wheels = fault.kind not in ("zero", "commands")
    wheels = Motion(v / TOLD.v, u / TOLD.u) if by_wheels else Motion(1.0, 1.0)
    assert told.wheels == pytest.approx(wheels)


def test_nan_and_silence() -> None:
    nan = faulty_twist(odometry_fault_rows([section("nan")]), 3.0, PERIOD, MOVES, TOLD, WANTED)
    assert math.isnan(nan.told.v)
    assert math.isnan(nan.told.u)
    assert faulty_twist(odometry_fault_rows([section("silent")]), 3.0, PERIOD, MOVES, TOLD, WANTED).silent


def test_a_fault_lasts_as_long_as_it_says_and_without_that_for_good() -> None:
    rows = odometry_fault_rows([section("zero", duration_s=1.0)])
    assert [faulty_twist(rows, t, PERIOD, MOVES, TOLD, WANTED).told.v == 0.0 for t in (2.9, 3.0)] == [
        True,
        False,
    ]
    assert (
        faulty_twist(odometry_fault_rows([section("zero")]), 1e6, PERIOD, MOVES, TOLD, WANTED).told.v == 0.0
    )


def test_a_pose_is_reset_once() -> None:
    rows = odometry_fault_rows([section("reset")])
    assert [faulty_twist(rows, 2.0 + k * PERIOD, PERIOD, MOVES, TOLD, WANTED).resets for k in range(3)] == [
        True,
        False,
        False,
    ]


def test_reckoning_follows_the_true_arcs_by_the_wheels_share() -> None:
    at = told = Pose(0.2, 0.1, 2.9)
    last, half = Reckoning(told, at), Reckoning(told, at)
    for k in range(60):
        u = math.sin(0.3 * k)
        at = advance(at, 0.1, u, PERIOD)
        told = advance(told, 0.05, 0.5 * u, PERIOD)
        last = reckoned(last, at, Motion(1.0, 1.0), False)
        half = reckoned(half, at, Motion(0.5, 0.5), False)
    assert last.told == pytest.approx(at, abs=1e-12)
    assert half.told == pytest.approx(told, abs=1e-12)
    assert reckoned(last, at, Motion(1.0, 1.0), True).told == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


class Heard(NamedTuple):
    """Odometry of a robot as it arrives."""

    robot: int
    sampled: bool
    arrives_ns: int
    odometry: Odometry


def heard(faults: str) -> list[Heard]:
    """What the three robots of a chain tell in a second of a drive whose leader sets off at once."""
    scenario = load_scenario("turtlebot3", [f"robot.odometry_faults=[{faults}]"])
    plant = Plant(scenario, chain_poses(scenario, 3), EPOCH_NS)
    plant.let_go()
    found: list[Heard] = []
    while (happened := plant.advance(EPOCH_NS + 1_000_000_000)).kind != NOTHING:
        if happened.kind not in (SAMPLE, ODOMETRY):
            continue
        rows = plant.memory.odometry
        for robot in range(3):
            told = load(Odometry, rows, happened.slot * 3 + robot)
            if told.arrives_ns == happened.stamp_ns:
                found.append(Heard(robot, happened.kind == SAMPLE, happened.stamp_ns, told))
    return found


def test_only_followers_fall_silent() -> None:
    robots = [each.robot for each in heard('{kind="silent", at_s=0.5}')]
    assert robots.count(0) == 31
    assert robots.count(1) == robots.count(2) == 15


def test_a_delay_is_on_the_way_and_in_the_stamp() -> None:
    found = [each for each in heard('{kind="delay", at_s=0.5, delay_s=0.1}') if each.robot == 1]
    late = [each for each in found if not each.sampled]
    assert len(late) == 13
    assert min(each.arrives_ns for each in late) == EPOCH_NS + 600_000_000
    assert max(each.arrives_ns for each in found if each.sampled) < EPOCH_NS + 500_000_000


def test_rows_hold_every_kind() -> None:
    sections = [section(kind.name.lower()) for kind in OdometryFaultKind]
    assert columns_of(odometry_fault_rows(sections))["kind"].tolist() == sorted(OdometryFaultKind)
    assert NAN == OdometryFaultKind.NAN
