"""A run of the compiled loop is the lockstep run of the same seed, to the last bit."""

from __future__ import annotations

import math
from operator import attrgetter
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from controllers.guard import reason_of
from estimation.tracking.estimate import Joint
from hil.errors import CheckFailedError
from hil.lockstep.flyer import Flown, Flyer
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.nodes.controller import ControllerNode
from hil.nodes.estimator import EstimatorNode
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.message_types import Command, LeaderEstimate, Truth
from hil.wire.messages import decode_as, to_ns
from hil.wire.topics import link_topics

SEED = 11
ESTIMATED = ("rho", "alpha2", "rho_dot", "alpha2_dot", "v1", "alpha1", "u1", "v2", "u2", "nis", "status")
TRUE = attrgetter(
    *("leader_x", "leader_y", "leader_theta", "follower_x", "follower_y", "follower_theta"),
    *("v1", "u1", "v2", "u2"),
)
TRUTHS = (
    *((body, name) for body in ("leader", "follower") for name in ("x", "y", "theta")),
    *((f"{body}_motion", name) for body in ("leader", "follower") for name in ("v", "u")),
)
UPPER = np.triu_indices(5)

SLOW = ["mocap.latency_s=0.2", "mocap.loss=0.2", "controller.max_age_s=0.4"]
# Good measurements are refused, tentative tracks take over, tracks coast and are lost, commands grow stale.
TORN = ["mocap.loss=0.85", "estimator.gate_probability=0.7", "estimator.reacquire_frames=2"]
TORN += ["estimator.coast_after_s=0.04", "estimator.lost_after_s=0.12", "controller.max_age_s=0.06"]
OTHER_ROBOT = ["robot.v_resolution=0", "controller.v_resolution=0", "controller.transport_s=0.02"]
OTHER_ROBOT += ["robot.lag_s=0", "controller.tick_hz=200", "mocap.rate_hz=97", "mocap.loss=0.1"]
LATE = ["mocap.jitter_s=0.03", "robot.odometry_delay_s=0.04", "robot.odometry_scale_v=1.02"]
AUTO = ["estimator.own_motion=auto"]
BODY = ["estimator.front_end=body"]
ANSWERS = [
    "estimator.input_time_constant_s=0.1",
    "estimator.input_lag_s=0.02",
    "estimator.input_scale_v=0.97",
]
FAULTS = [
    'mocap.faults=[{kind="swap", at_s=0.8}, {kind="turn", body="follower", at_s=1.0, duration_s=0.1, '
    'angle=3.14}, {kind="freeze", body="leader", at_s=1.3, duration_s=0.2}, {kind="dropout", at_s=1.7, '
    "duration_s=0.3}]"
]


def program(kind: str, **numbers: object) -> str:
    values = "".join(f", {name} = {value}" for name, value in numbers.items())
    return f'leader.program={{ kind = "{kind}"{values} }}'


def lying(kind: str, **numbers: object) -> str:
    values = "".join(f", {name} = {value}" for name, value in numbers.items())
    return f'robot.odometry_faults=[{{ kind = "{kind}", at_s = 0.3{values} }}]'


MOUNTED = [f"{key}=[0.05, -0.02, 0.2]" for key in ("leader.mount", "follower.mount")]
MOUNTED += [f"mocap.{key}=[0.05, -0.02, 0.2]" for key in ("leader_mount", "follower_mount")]

CASES = [
    ("turtlebot3", ["estimator.kind=ekf", *LATE, *FAULTS]),
    ("turtlebot3", ["estimator.kind=ekf", "controller.law=ideal", *SLOW]),
    ("turtlebot3", ["estimator.kind=ukf", "controller.law=faded", *LATE, "estimator.own_motion=fused"]),
    ("turtlebot3", ["estimator.kind=ekf", *TORN, "mocap.jitter_s=0.02"]),
    (
        "turtlebot3",
        [*OTHER_ROBOT, program("impulse", v=0.08, u_amplitude=0.5, t_centre=1.0, t_width=0.3), *BODY],
    ),
    ("turtlebot3", ["mocap.latency_s=0", "formation.side=left", program("constant", v=0.1, u=0.3)]),
    ("turtlebot3", ["estimator.kind=ukf", *SLOW, *BODY, "estimator.own_motion=mocap", "mocap.jitter_s=0.05"]),
    (
        "turtlebot3",
        ["estimator.kind=difference", program("table", t=[0.2, 1.0], v=[0.05, 0.1], u=[0.0, 0.6])],
    ),
    ("turtlebot3", ["estimator.kind=difference", "controller.law=feedforward", *LATE, *BODY]),
    # A leader that drives backwards, turns back, and stands.
    (
        "turtlebot3",
        [program("table", t=[0, 1, 1.5, 2, 2.1], v=[-0.1, -0.1, 0.1, 0.1, 0], u=[0, 0, 0.5, 0, 0])],
    ),
    (
        "turtlebot3",
        ["mocap.clock_offset_s=0.03", "mocap.clock_drift_ppm=200", "estimator.stamp_offset_s=0.01"],
    ),
    ("turtlebot3", ["estimator.kind=imm", "mocap.jitter_s=0.02"]),
    ("turtlebot3", [*AUTO, *LATE]),
    ("turtlebot3", [*AUTO, *BODY, lying("scale", factor=3.0), "mocap.jitter_s=0.02"]),
    ("turtlebot3", [*AUTO, lying("silent"), "run.duration_s=1.5"]),
    ("turtlebot3", [*AUTO, lying("nan"), "run.duration_s=1.5"]),
    ("turtlebot3", [*AUTO, lying("zero")]),
    ("turtlebot3", [*AUTO, *ANSWERS, lying("commands")]),
    ("turtlebot3", [*BODY, *ANSWERS, lying("commands"), "estimator.own_motion=odometry"]),
    ("turtlebot3", [*AUTO, lying("delay", delay_s=0.05), "run.duration_s=1.5"]),
    ("chain5-turtlebot3", [*AUTO, lying("reversed"), "mocap.loss=0.1"]),
    ("turtlebot3", ["estimator.own_motion=odometry", lying("reset"), lying("slip")]),
    ("turtlebot3", ["estimator.kind=ekf-filterpy", *BODY]),
    ("changing-sides", ["formation.change_sides_at_s=[1.0, 1.6]"]),
    ("chain5-turtlebot3", ["controller.law=ideal", "mocap.jitter_s=0.01", "mocap.loss=0.1"]),
    ("turtlebot3", [*MOUNTED, "mocap.follower_mount=[0.02, 0.03, 0.5]", "run.duration_s=4"]),
    ("turtlebot3", [*MOUNTED, "estimator.kind=ukf", *BODY, "mocap.jitter_s=0.02"]),
    ("chain5-turtlebot3", MOUNTED),
]


def scenario_of(name: str, overrides: list[str]) -> Scenario:
    return load_scenario(name, ["run.duration_s=2.5", f"run.seed={SEED}", *overrides])


@pytest.mark.parametrize(("name", "overrides"), CASES, ids=[f"{name} {' '.join(of)}" for name, of in CASES])
def test_a_run_is_the_lockstep_run_of_the_same_seed_to_the_last_bit(
    name: str, overrides: list[str], tmp_path: Path
) -> None:
    scenario = scenario_of(name, overrides)
    run_lockstep(scenario, tmp_path / "run.mcap")
    log, flyer = read_log(tmp_path / "run.mcap"), Flyer(scenario)
    flyer.fly(SEED + 1)  # nothing of another run may stay behind
    flown = flyer.fly(SEED)
    for k, link in enumerate(links_of(scenario)):
        topics = link_topics(link)
        truth = [decode_as(record.payload, Truth) for record in log.records([topics.truth])]
        same_truth(flown, k, truth)
        estimates = [decode_as(record.payload, LeaderEstimate) for record in log.records([topics.estimate])]
        same_estimates(flown, k, estimates)
        commands = [decode_as(record.payload, Command) for record in log.records([topics.command])]
        same_commands(flown, k, commands)


def same_truth(flown: Flown, k: int, wanted: list[Truth]) -> None:
    rows = flown.truth[k :: flown.pairs]
    found = np.column_stack([rows[body][name] for body, name in TRUTHS])
    np.testing.assert_array_equal(found, np.array([TRUE(message) for message in wanted]))
    assert rows["at_ns"].tolist() == [to_ns(message.header.stamp) for message in wanted]


def same_estimates(flown: Flown, k: int, wanted: list[LeaderEstimate]) -> None:
    rows = flown.estimates[flown.estimates["follower"] == k]
    found = rows["estimate"]
    values = np.array([attrgetter(*ESTIMATED)(message) for message in wanted])
    np.testing.assert_array_equal(np.column_stack([found[name] for name in ESTIMATED]), values)
    joint = np.column_stack([found["joint"][name] for name in Joint._fields])
    np.testing.assert_array_equal(joint, [e.covariance.reshape(5, 5)[UPPER] for e in wanted])
    assert rows["now_ns"].tolist() == [to_ns(e.computed) for e in wanted]
    assert found["capture_ns"].tolist() == [to_ns(e.header.stamp) for e in wanted]
    assert found["measured_ns"].tolist() == [to_ns(e.measured) for e in wanted]


def same_commands(flown: Flown, k: int, wanted: list[Command]) -> None:
    rows = flown.commands[flown.commands["follower"] == k]
    found = rows["command"]
    values = np.array([(c.v2, c.u2, c.v2_wanted, c.u2_wanted, c.saturated) for c in wanted])
    names = ("v", "u", "v_wanted", "u_wanted", "saturated")
    np.testing.assert_array_equal(np.column_stack([found[name] for name in names]), values)
    assert rows["now_ns"].tolist() == [to_ns(c.header.stamp) for c in wanted]
    stops = [reason_of(int(reason)) for reason in found["reason"]]
    assert [stop.value if stop else "" for stop in stops] == [c.stop for c in wanted]


def test_frames_that_are_lost_are_known() -> None:
    scenario = scenario_of("turtlebot3", ["mocap.loss=0.3"])
    flown = Flyer(scenario).fly(SEED)
    share = float(np.mean(flown.truth["arrives"]))
    assert share == pytest.approx(0.7, abs=4.0 * math.sqrt(0.21 / len(flown.truth)))


def test_what_is_on_its_way_may_be_more_than_there_was_room_for() -> None:
    crowded = scenario_of(
        "turtlebot3", ["mocap.latency_s=0.9", "mocap.rate_hz=240", "controller.max_age_s=2"]
    )
    first = Flyer(crowded)
    first.fly(SEED)
    assert len(first.rooms.lab.underway) > 64


@pytest.mark.parametrize("rate", [1.0, 30.0, 97.0, 120.0, 333.0, 1000.0])
def test_rings_have_a_power_of_two_of_rows(rate: float) -> None:
    told = [f"mocap.rate_hz={rate}", f"robot.odometry_rate_hz={rate}", "controller.max_age_s=0.77"]
    scenario = scenario_of("turtlebot3", told)
    rooms, desk = Flyer(scenario).rooms, EstimatorNode(scenario).rows_only(0).memory.desk
    flown = (rooms.points, rooms.history, rooms.own, rooms.ways, rooms.sent, rooms.lab.underway)
    live = (
        desk.points,
        desk.history,
        desk.own,
        desk.ways,
        ControllerNode(scenario).rows_only(0).desk.commands,
    )
    for rows in (*flown, *live):
        assert len(cast("NDArray[np.void]", rows)).bit_count() == 1


def test_a_leader_that_never_sets_off_is_an_error() -> None:
    flyer = Flyer(scenario_of("turtlebot3", ["mocap.loss=0.999999999"]))
    with pytest.raises(CheckFailedError, match=r"mocap\.loss"):
        flyer.fly(SEED)
