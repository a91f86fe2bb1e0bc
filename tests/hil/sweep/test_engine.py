from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest

from estimation.consistency.cramer_rao import TruePath, cramer_rao
from estimation.models.measurement import PoseNoise
from estimation.tracking.estimate import QUANTITIES
from formation.angles import wrap
from hil.errors import CheckFailedError, UsageError
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.nodes.estimator import EstimatorNode
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.sweep.engine import Engine
from hil.wire.message_types import Command, LeaderEstimate, Truth
from hil.wire.messages import decode_as, to_ns

SEED = 11
TOLERANCE = 1e-9
VALUES = ("rho", "alpha2", "rho_dot", "alpha2_dot", "v1", "alpha1", "u1", "v2", "u2")
ANGLES = [VALUES.index("alpha2"), VALUES.index("alpha1")]
TRUTHS = ("lx", "ly", "lheading", "fx", "fy", "fheading", "v1", "u1", "v2", "u2")
TRUE = attrgetter(
    *("leader_x", "leader_y", "leader_theta", "follower_x", "follower_y", "follower_theta"),
    *("v1", "u1", "v2", "u2"),
)
REASONS = ("", "stopped", "no estimate", "lost", "not settled", "stale", "not finite")

SMOOTH = ["mocap.latency_s=0.03"]
PERFECT = ["mocap.latency_s=0"]
SLOW = ["mocap.latency_s=0.2", "mocap.loss=0.2", "controller.max_age_s=0.4"]
# Good measurements are refused, candidates take over, tracks coast and are lost, commands grow stale.
TORN = ["mocap.loss=0.85", "estimator.gate_probability=0.7", "estimator.reacquire_frames=2"]
TORN += ["estimator.coast_after_s=0.04", "estimator.lost_after_s=0.12", "controller.max_age_s=0.06"]
OTHER_ROBOT = ["robot.v_resolution=0", "controller.v_resolution=0", "controller.transport_s=0.02"]
OTHER_ROBOT += ["robot.lag_s=0", "controller.tick_hz=200", "mocap.rate_hz=97", "mocap.loss=0.1"]


def program(kind: str, **numbers: object) -> str:
    values = "".join(f", {name} = {value}" for name, value in numbers.items())
    return f'leader.program={{ kind = "{kind}"{values} }}'


CASES = [
    ["estimator.kind=ekf", "controller.law=independent", *SMOOTH],
    ["estimator.kind=ekf", "controller.law=ideal", *SLOW],
    ["estimator.kind=ekf", "controller.law=feedforward", *SLOW],
    ["estimator.kind=ukf", "controller.law=faded", *SMOOTH],
    ["estimator.kind=ekf", *TORN],
    [
        "estimator.kind=ekf",
        *OTHER_ROBOT,
        program("impulse", v=0.08, u_amplitude=0.5, t_centre=1.0, t_width=0.3),
    ],
    ["estimator.kind=ukf", "controller.law=independent", *PERFECT, program("constant", v=0.1, u=0.3)],
    ["estimator.kind=ukf", "controller.law=ideal", *SLOW],
    ["estimator.kind=ukf", *TORN],
    ["estimator.kind=difference", "controller.law=ideal", *PERFECT],
    ["estimator.kind=difference", *SMOOTH, program("table", t=[0.2, 1.0], v=[0.05, 0.1], u=[0.0, 0.6])],
    ["estimator.kind=difference", *SLOW, "mocap.sigma_position=0.003", "estimator.sigma_position=0.003"],
]


@dataclass(frozen=True)
class Lockstep:
    estimates: list[LeaderEstimate]
    commands: list[Command]
    truth: list[Truth]


def scenario_of(*overrides: str) -> Scenario:
    return load_scenario("turtlebot3", ["run.duration_s=2.5", f"run.seed={SEED}", *overrides])


def lockstep(scenario: Scenario, folder: Path) -> Lockstep:
    run_lockstep(scenario, folder / "run.mcap")
    log = read_log(folder / "run.mcap")
    return Lockstep(
        [decode_as(record.payload, LeaderEstimate) for record in log.records(["follower/leader_estimate"])],
        [decode_as(record.payload, Command) for record in log.records(["follower/command"])],
        [decode_as(record.payload, Truth) for record in log.records(["truth"])],
    )


def ns(messages: list[Command] | list[LeaderEstimate]) -> list[int]:
    return [to_ns(message.header.stamp) - EPOCH_NS for message in messages]


@pytest.mark.parametrize("overrides", CASES, ids=" ".join)
def test_a_run_equals_the_lockstep_run_of_the_same_seed(overrides: list[str], tmp_path: Path) -> None:
    scenario = scenario_of(*overrides)
    wanted = lockstep(scenario, tmp_path)
    engine = Engine(scenario, every_estimate=True)
    engine.fly(SEED + 1)  # nothing of another run may stay behind
    flight = engine.fly(SEED)

    truth = np.array([TRUE(message) for message in wanted.truth])
    found = np.column_stack([flight.frames[f"true_{name}"] for name in TRUTHS])
    gap = found - truth
    gap[:, [2, 5]] = wrap(gap[:, [2, 5]])
    assert np.max(np.abs(gap)) < TOLERANCE

    assert flight.sent["at_ns"].tolist() == [at + engine.transport_ns for at in ns(wanted.commands)]
    assert [REASONS[reason] for reason in flight.sent["reason"]] == [c.stop for c in wanted.commands]
    commands = np.array([[message.v2, message.u2] for message in wanted.commands])
    assert np.max(np.abs(np.column_stack([flight.sent["v"], flight.sent["u"]]) - commands)) < TOLERANCE

    told = wanted.estimates
    assert flight.frames["at_ns"][flight.told["frame"]].tolist() == ns(told)
    assert flight.told["now_ns"].tolist() == [to_ns(e.computed) - EPOCH_NS for e in told]
    assert flight.told["measured_ns"].tolist() == [to_ns(e.measured) - EPOCH_NS for e in told]
    assert flight.told["status"].tolist() == [e.status for e in told]
    estimates = engine.estimates()
    values = np.array([attrgetter(*VALUES)(message) for message in told])
    gap = np.column_stack([estimates[name] for name in VALUES]) - values
    gap[:, ANGLES] = wrap(gap[:, ANGLES])
    gap[values[:, VALUES.index("v1")] == 0.0, VALUES.index("alpha1")] = 0.0  # no speed has no direction
    assert np.max(np.abs(gap)) < TOLERANCE
    np.testing.assert_allclose(flight.told["nis"], [e.nis for e in told], rtol=TOLERANCE, atol=TOLERANCE)
    variances = np.column_stack([estimates[f"var_{name}"] for name in QUANTITIES])
    np.testing.assert_allclose(variances, [e.covariance[::6] for e in told], rtol=1e-7)


def test_the_least_variances_are_those_of_the_posterior_cramer_rao_bound() -> None:
    scenario = scenario_of("mocap.loss=0.1", "mocap.sigma_position=0.001")
    engine = Engine(scenario)
    frames = engine.fly(SEED).frames
    first = 60
    wanted = np.zeros(len(frames), dtype=np.bool_)
    wanted[200::8] = True
    found = engine.least_variances(first, wanted)
    cos, sin = np.cos(frames["true_lheading"]), np.sin(frames["true_lheading"])
    v1 = frames["true_v1"]
    columns = [frames["true_lx"], frames["true_ly"], v1 * cos, v1 * sin, frames["true_u1"]]
    path = TruePath(
        capture_ns=frames["at_ns"][first:],
        leader=np.column_stack(columns)[first:],
        follower_pose=np.column_stack([frames[f"true_{name}"] for name in TRUTHS[3:6]])[first:],
        follower_motion=np.column_stack([frames["true_v2"], frames["true_u2"]])[first:],
        measured=frames["lost"][first:] == 0,
    )
    model = EstimatorNode(scenario).tracker.estimator.model
    robot = scenario.robot
    bounds = cramer_rao(
        path,
        model,
        PoseNoise(0.001, scenario.mocap.sigma_heading),
        robot.odometry_sigma_v,
        robot.odometry_sigma_u,
    )
    assert found.count == np.count_nonzero(wanted)
    for name, bound in bounds.items():
        assert found.variances[name] == pytest.approx(float(np.mean(bound[wanted[first:]] ** 2)), rel=1e-7)


@pytest.mark.parametrize(
    "override",
    [
        *("mocap.jitter_s=0.01", "mocap.latency_s=2", "mocap.clock_offset_s=5", "estimator.kind=imm"),
        *("estimator.front_end=body", "estimator.own_motion=mocap", "formation.side=left"),
    ],
)
def test_what_the_loop_does_not_have_is_refused(override: str) -> None:
    with pytest.raises(UsageError, match=override.partition("=")[0]):
        Engine(scenario_of(override))


def test_a_leader_that_never_sets_off_is_an_error() -> None:
    engine = Engine(scenario_of("mocap.loss=0.999999999"))
    with pytest.raises(CheckFailedError, match=r"mocap\.loss"):
        engine.fly(SEED)
