"""Faults of the motion capture, injected at random: what the estimator makes of them.

    python benchmarks/faults.py [--injections 1000] [--seed 1] [--front-end world] [FAULT ...]

The pair of the ``turtlebot3`` scenario at 120 Hz drives on undisturbed, and what mocap shows of it is spoilt
once, at a random instant, for a random time, on a random body. Frames go through the estimator's pure core
(its step, estimate, live bound) with noise, odometry and latency of the scenario. Printed for each fault:
estimates with status TRACKING, how many of these have rho_dot, alpha2_dot, v1 or alpha1 more than five of
their own standard deviations off the truth, how many v1 or alpha1 outside the extended bound that goes out
with them, frames rejected, and how long after the fault's end it takes until TRACKING: median, p99, maximum,
and the share that takes more than half a second, or does not come back at all within a second.

For a step that stays, its end is the step itself. While such a jump is uncertain the estimate is judged by
the truth, and thereafter by what mocap shows: nobody can know a body that stays where it jumped to be
elsewhere.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from controllers.laws import independent
from controllers.limits import Limits
from estimation.bounds.window_velocity import window_velocity
from estimation.models.measurement import FrontEnd, PairSeen
from estimation.own_motion.odometry_check import OdometrySample
from estimation.own_motion.odometry_history import MotionSample
from estimation.tracking.estimate import Estimate
from estimation.tracking.track_point import GATED, NO_JUMP
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.records import load, store
from formation.shape import Shape, follower_pose, shape_of, shape_rates
from hil.emulator.faults import Pair, fault_rows, faulty
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import TimedFrame
from hil.nodes.estimator_records import Known
from hil.scenario.emulated import FaultSection
from hil.scenario.files import load_scenario
from hil.scenario.parts import gains, leader_program
from hil.scenario.schema import Scenario
from hil.wire.assumed_errors import bounds_of

PERIOD_NS = 8_333_333
PERIOD = PERIOD_NS * 1e-9
ODOMETRY_EVERY = 4
SETTLING, AFTER = 1.0, 1.2
"""Seconds before a fault at least, and judged after it."""
VARIETY = 0.5
"""Seconds within which the instant of a fault is drawn."""
STAYS = 1e6
"""Duration [s] of a step that stays; what follows is judged for the time of uncertainty and a second more."""

Body = Literal["leader", "follower", "both"]
Make = Callable[[np.random.Generator, float], FaultSection]


@dataclass(frozen=True)
class Moment:
    """Truth at one capture: the pair and how it moves; what was shown without fault; odometry heard since."""

    pair: Pair
    leader: Motion
    follower: Motion
    shown: Pair
    heard: list[MotionSample]


@dataclass
class Score:
    """What came of the injections of one fault."""

    injections: int = 0
    tracking: int = 0
    beyond_sigma: int = 0
    beyond_bound: int = 0
    frames: int = 0
    rejected: int = 0
    back: list[float] = field(default_factory=list)

    def row(self) -> str:
        back = np.array(self.back)
        there = back[np.isfinite(back)]
        times = [f"{1e3 * value:7.0f}" for value in (np.median(there), np.percentile(there, 99), there.max())]
        slow, never = np.mean(back > 0.5), np.mean(~np.isfinite(back))
        return (
            f"{self.injections:6d} {self.tracking:9d} {self.beyond_sigma:8d} {self.beyond_bound:8d} "
            f"{self.rejected / self.frames:9.5f} {' '.join(times)} {slow:7.3f} {never:7.3f}"
        )


def drive(scenario: Scenario, generator: np.random.Generator, frames: int) -> list[Moment]:
    """A pair abreast, from a random instant of the leader's program on, and what is measured of it."""
    program, law, robot = leader_program(scenario), gains(scenario), scenario.robot
    limits, begin = Limits(robot.v_max, robot.u_max), generator.uniform(0.0, 60.0)
    x, y, theta = generator.uniform([-2.0, -2.0, -math.pi], [2.0, 2.0, math.pi]).tolist()
    leader = Pose(x, y, theta)
    rho = scenario.formation.rho_0 * generator.uniform(0.8, 1.3)
    follower = follower_pose(Shape(rho, -math.pi / 2 + generator.normal(0.0, 0.2), math.pi / 2), leader)
    moments: list[Moment] = []
    heard: list[MotionSample] = []
    settle = 120
    for k in range(-settle, frames):
        driven = program(begin + k * PERIOD)
        shape = shape_of(leader, follower)
        wanted = independent(shape, driven.v, driven.u, law, limits)
        own = Motion(
            max(-limits.v_max, min(limits.v_max, wanted.v)), max(-limits.u_max, min(limits.u_max, wanted.u))
        )
        if k % ODOMETRY_EVERY == 0:
            v, u = own.v + generator.normal(0.0, robot.odometry_sigma_v), own.u
            u += generator.normal(0.0, robot.odometry_sigma_u)
            heard.append(MotionSample((k + settle) * PERIOD_NS, v, u))
        if k >= 0:
            shown = Pair(noisy(leader, scenario, generator), noisy(follower, scenario, generator))
            moments.append(Moment(Pair(leader, follower), driven, own, shown, heard))
            heard = []
        leader = advance(leader, driven.v, driven.u, PERIOD)
        follower = advance(follower, own.v, own.u, PERIOD)
    return moments


def noisy(pose: Pose, scenario: Scenario, generator: np.random.Generator) -> Pose:
    x, y, turned = generator.standard_normal(3).tolist()
    sigma = scenario.mocap.sigma_position
    theta = float(wrap(pose.theta + scenario.mocap.sigma_heading * turned))
    return Pose(pose.x + sigma * x, pose.y + sigma * y, theta)


def errors_of(found: Estimate, pair: Pair, leader: Motion, follower: Motion) -> dict[str, float]:
    """Errors against the truth, in the order of ``estimation.tracking.estimate.QUANTITIES`` but for u1."""
    shape = shape_of(pair.leader, pair.follower)
    rates = shape_rates(shape, leader, follower)
    return {
        "rho_dot": abs(found.rho_dot - rates.rho_dot),
        "alpha2_dot": abs(found.alpha2_dot - rates.alpha2_dot),
        "v1": abs(found.v1 - leader.v),
        "alpha1": abs(float(wrap(found.alpha1 - shape.alpha1))),
    }


def inject(
    node: EstimatorNode,
    fault: FaultSection | None,
    generator: np.random.Generator,
    score: Score,
    settling: float = SETTLING,
    after: float = AFTER,
) -> None:
    """One drive with one fault in it, judged from ``settling`` to ``after`` the fault's end [s]."""
    stays = fault is not None and fault.duration_s == STAYS
    at = settling if fault is None else fault.at_s
    end = at if fault is None or stays else at + max(fault.duration_s, PERIOD)
    uncertain_until = end + node.rules.step.settings.jump_uncertain_for
    until = uncertain_until + 1.0 if stays else end + after
    memory, assumed = node.begin(0).memory, node.rules.assumed
    last: Pair | None = None
    back = math.inf
    for k, moment in enumerate(drive(node.scenario, generator, math.ceil(until / PERIOD))):
        t, capture_ns = k * PERIOD, (k + 120) * PERIOD_NS
        for sample in moment.heard:
            heard = OdometrySample(sample.stamp_ns, sample.v2, sample.u2, False, Pose(0.0, 0.0, 0.0))
            store(memory.desk.sample, 0, heard)
            memory.take_odometry()
        faults = fault_rows([] if fault is None else [fault])
        frame = faulty(faults, t, PERIOD, moment.shown, last or moment.shown)
        if frame.lost:
            continue
        last = shown = frame.pair
        seen = PairSeen(shown.leader.x, shown.leader.y, shown.follower)
        store(memory.desk.frame, 0, TimedFrame(capture_ns, seen))
        memory.take_frame(capture_ns)
        found, verdict = load(Estimate, memory.desk.newest, 0), memory.notes.verdict
        score.frames += 1
        score.rejected += verdict == GATED
        if t < settling or found.status != Status.TRACKING:
            continue
        if t >= end - 1e-9:
            back = min(back, t - end)
        pair = moment.pair
        if stays and fault is not None and t > uncertain_until and found.jump == NO_JUMP:
            pair = faulty(fault_rows([fault]), t, PERIOD, pair, pair).pair
        errors = errors_of(found, pair, moment.leader, moment.follower)
        sd = np.sqrt(np.diagonal(found.covariance)).tolist()
        track = load(Known, memory.desk.known, 0).track
        window = window_velocity(memory.desk.points, track, assumed.positions.longest)
        bound_v1, bound_alpha1, _ = bounds_of(found, assumed, window)
        score.tracking += 1
        score.beyond_sigma += any(e > 5.0 * s for e, s in zip(errors.values(), sd, strict=False))
        score.beyond_bound += errors["v1"] > bound_v1 or errors["alpha1"] > bound_alpha1
    score.injections += 1
    score.back.append(back)


def _offset(generator: np.random.Generator, size: float) -> tuple[float, float]:
    angle = generator.uniform(-math.pi, math.pi)
    return (size * math.cos(angle), size * math.sin(angle))


def _body(generator: np.random.Generator) -> Body:
    return cast("Body", str(generator.choice(["leader", "follower"])))


def _log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(generator.uniform(math.log(low), math.log(high))))


def _outlier(body: Body) -> Make:
    return lambda g, at: FaultSection(
        kind="step", at_s=at, body=body, offset=_offset(g, _log_uniform(g, 1e-3, 1.0))
    )


def _turned_once(g: np.random.Generator, at: float) -> FaultSection:
    angle = _log_uniform(g, 0.01, math.pi) * float(g.choice([-1.0, 1.0]))
    return FaultSection(kind="turn", at_s=at, body="follower", angle=angle)


def _flip(body: Body) -> Make:
    return lambda g, at: FaultSection(
        kind="turn", at_s=at, body=body, duration_s=_log_uniform(g, PERIOD, 1.0)
    )


def _frozen(g: np.random.Generator, at: float) -> FaultSection:
    body = cast("Body", str(g.choice(["leader", "follower", "both"])))
    return FaultSection(kind="freeze", at_s=at, body=body, duration_s=_log_uniform(g, 2 * PERIOD, 2.0))


def _step(g: np.random.Generator, at: float, duration: float) -> FaultSection:
    return FaultSection(kind="step", at_s=at, body=_body(g), offset=_offset(g, 0.02), duration_s=duration)


FAULTS: dict[str, Make | None] = {
    "none": None,
    "outlier leader": _outlier("leader"),
    "outlier follower": _outlier("follower"),
    "outlier heading": _turned_once,
    "swap": lambda g, at: FaultSection(kind="swap", at_s=at, duration_s=_log_uniform(g, PERIOD, 1.0)),
    "flip follower": _flip("follower"),
    "flip leader": _flip("leader"),
    "frozen": _frozen,
    "step and back": lambda g, at: _step(g, at, _log_uniform(g, 0.05, 1.0)),
    "step that stays": lambda g, at: _step(g, at, STAYS),
    "dropout": lambda g, at: FaultSection(kind="dropout", at_s=at, duration_s=g.uniform(PERIOD, 2.0)),
}


def injected(
    name: str, count: int, seed: int, node: EstimatorNode, settling: float = SETTLING, after: float = AFTER
) -> Score:
    """Score of ``count`` injections of a fault; each has random numbers of its own."""
    score, make = Score(), FAULTS[name]
    for number in range(count):
        generator = np.random.default_rng([seed, list(FAULTS).index(name), number])
        at = settling + float(generator.uniform(0.0, VARIETY))
        fault = None if make is None else make(generator, at)
        inject(node, fault, generator, score, settling, after)
    return score


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("faults", nargs="*", default=list(FAULTS), metavar="FAULT")
    parser.add_argument("--injections", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--front-end", choices=[each.value for each in FrontEnd], default="world")
    given = parser.parse_args()
    node = EstimatorNode(load_scenario("turtlebot3", [f"estimator.front_end={given.front_end}"]))
    print(
        f"{'fault':17s} {'number':>6s} {'tracking':>9s} {'>5 sigma':>8s} {'>bound':>8s} {'rejected':>9s} "
        f"{'back ms':>7s} {'p99':>7s} {'max':>7s} {'>0.5 s':>7s} {'never':>7s}"
    )
    for name in given.faults:
        print(f"{name:17s} {injected(name, given.injections, given.seed, node).row()}", flush=True)


if __name__ == "__main__":
    main()
