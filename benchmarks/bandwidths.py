"""The leader's process noise found, against the same filter that goes by what it is told.

    python benchmarks/bandwidths.py [--runs 100] [--only random gentle ...]

Leaders of several kinds are seen with noise that is told rightly and estimated twice, with
``estimator.process_noise`` given and estimated, otherwise by the defaults: no kind has constants of its own.
For each quantity there are the RMSE, its ratio to that of a filter told the kind's own bandwidths where it
has some, the NEES (mean of e^2 / variance, 1 if reported errors are right; median over runs) and the share
beyond five standard deviations, over tracking samples from ``from`` [s] on.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.random_leaders import random_leader
from estimation.consistency.filter_bank import Member
from estimation.consistency.slip_estimate import BANK
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import Measurement, PoseNoise, measure_body, measure_world
from estimation.own_motion.odometry_check import WayEntry
from estimation.own_motion.odometry_history import MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.estimate import Estimate
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.tracker import TRACKING
from formation.kernel import entry
from formation.pose import Pose
from formation.records import Rows, borrowed, columns_of, load, row_of, rows_of, size, store
from formation.wrapping import wrapped
from hil.nodes import estimator_step
from hil.nodes.estimator_desk import NOTHING_KNOWN
from hil.nodes.estimator_memory import rules_of
from hil.nodes.estimator_records import Known, Memory, Rules
from hil.scenario.files import load_scenario

FloatArray = NDArray[np.float64]

K_V, V_EPS = 0.1, 0.04
NAMES = ("v1", "alpha1", "u1")
BESIDE = 0.4
_ROOM = 256


class Driven(NamedTuple):
    """Path of a leader, (n,) each: time [s], place [m], speed [m/s], heading [rad], turn rate [rad/s]."""

    t: FloatArray
    x: FloatArray
    y: FloatArray
    v: FloatArray
    heading: FloatArray
    u: FloatArray


class Kind(NamedTuple):
    """A kind of leader, how it is seen, and what is told of it.

    ``sigma``: of a position [m], or of range [m] and bearing [rad]. ``told``: bandwidths of turn and speed
    that fit it, if any do. ``since``: from when [s] on errors count.
    """

    drive: Callable[[np.random.Generator, FloatArray], Driven]
    rate: float
    duration: float
    k_u: float
    sigma: tuple[float, ...]
    told: tuple[float, float] | None
    since: float


def driven(t: FloatArray, v: FloatArray, u: FloatArray, heading: float, lag: float) -> Driven:
    """Path of a robot that follows wanted speeds and turn rates (n,) with a lag [s], by small arcs."""
    fine = 4
    dt = (t[1] - t[0]) / fine
    speeds, turns = np.repeat(v, fine), np.repeat(u, fine)
    if lag > 0.0:
        share = -math.expm1(-dt / lag)
        speeds, turns = _lagged(speeds, share), _lagged(turns, share)
    headings = heading + np.concatenate([[0.0], np.cumsum(turns[:-1] * dt)])
    middle = headings + 0.5 * turns * dt
    x = np.concatenate([[0.0], np.cumsum(speeds * np.cos(middle) * dt)[:-1]])
    y = np.concatenate([[0.0], np.cumsum(speeds * np.sin(middle) * dt)[:-1]])
    return Driven(t, x[::fine], y[::fine], speeds[::fine], headings[::fine], turns[::fine])


def _lagged(wanted: FloatArray, share: float) -> FloatArray:
    got, now = np.empty_like(wanted), float(wanted[0])
    for k, goal in enumerate(wanted.tolist()):
        got[k] = now
        now += share * (goal - now)
    return got


def swinging(generator: np.random.Generator, t: FloatArray) -> Driven:
    """The leader of ``turtlebot3``: even speed, turn rate in swings of four seconds."""
    u = 0.2 + 0.5 * np.sin(0.5 * math.pi * (t + generator.uniform(0.0, 4.0)))
    return driven(t, np.full_like(t, 0.08), u, generator.uniform(-3.0, 3.0), 0.1)


def stopping(generator: np.random.Generator, t: FloatArray) -> Driven:
    """Drives and stands by turns, steering slowly while it drives."""
    phase = t + generator.uniform(0.0, 4.0)
    goes = phase % 4.0 < 2.4
    u = 0.3 * np.sin(2.0 * math.pi * t / generator.uniform(4.0, 10.0) + generator.uniform(0.0, 6.0))
    return driven(t, np.where(goes, 0.08, 0.0), np.where(goes, u, 0.0), generator.uniform(-3.0, 3.0), 0.1)


def stepping(generator: np.random.Generator, t: FloatArray) -> Driven:
    """Speed and turn rate anew every two to four seconds."""
    v, u, k = np.empty_like(t), np.empty_like(t), 0
    while k < len(t):
        n = round(generator.uniform(2.0, 4.0) / (t[1] - t[0]))
        v[k : k + n], u[k : k + n] = generator.uniform(0.04, 0.1), generator.uniform(-0.7, 0.7)
        k += n
    return driven(t, v, u, generator.uniform(-3.0, 3.0), 0.1)


def gentle(generator: np.random.Generator, t: FloatArray) -> Driven:
    """Slow sines of random phase, of periods from 15 to 30 s."""
    turns = 2.0 * math.pi * t
    v = 0.08 + 0.02 * np.sin(turns / generator.uniform(15.0, 30.0) + generator.uniform(0.0, 2.0 * math.pi))
    u = 0.2 * np.sin(turns / generator.uniform(15.0, 30.0) + generator.uniform(0.0, 2.0 * math.pi))
    return driven(t, v, u, generator.uniform(-3.0, 3.0), 0.0)


def by_chance(generator: np.random.Generator, t: FloatArray) -> Driven:
    """As the filter's own model says, with the default bandwidths."""
    heading = generator.uniform(-3.0, 3.0)
    start = np.array([0.0, 0.0, 0.08 * math.cos(heading), 0.08 * math.sin(heading), 0.0])
    noise = ProcessNoise.by_rule(LeaderLimits(V_EPS, K_V, 0.7), 0.5)
    x, y, vx, vy, u = random_leader(generator, start, len(t), t[1] - t[0], noise).T
    return Driven(t, x, y, np.hypot(vx, vy), np.arctan2(vy, vx), u)


SHARP = (0.0003,)
KINDS = {
    "turtlebot3": Kind(swinging, 120.0, 30.0, 0.7, SHARP, None, 15.0),
    "random": Kind(by_chance, 120.0, 30.0, 0.7, SHARP, (0.5, 0.01), 2.0),
    "stop-and-go": Kind(stopping, 120.0, 30.0, 0.7, SHARP, None, 2.0),
    "steps": Kind(stepping, 120.0, 30.0, 0.7, SHARP, None, 2.0),
    "steps 240 Hz": Kind(stepping, 240.0, 30.0, 0.7, SHARP, None, 2.0),
    "gentle": Kind(gentle, 10.0, 60.0, 0.5, (0.025, 0.02), (0.03, 0.01), 15.0),
}


@entry
def followed(
    rules: Rows[Rules],
    knowns: Rows[Known],
    points: Rows[TrackPoint],
    history: Rows[MotionSample],
    own: Rows[OwnPoint],
    ways: Rows[WayEntry],
    bank: Rows[Member],
    seen: Rows[Measurement],
    estimates: Rows[Estimate],
) -> int:
    """Take measurements in as a node does; an estimate for each."""
    memory = Memory(borrowed(points), borrowed(history), borrowed(own), borrowed(ways), borrowed(bank))
    fixed, tracked = load(Rules, rules, 0), borrowed(knowns)
    for k in range(size(seen)):
        measurement = load(Measurement, seen, k)
        estimator_step.take(tracked, memory, fixed, measurement)
        told = estimator_step.estimate(load(Known, tracked, 0), memory.points, fixed, measurement.capture_ns)
        store(estimates, k, told.estimate)
    return size(seen)


def measured(generator: np.random.Generator, path: Driven, sigma: tuple[float, ...]) -> Rows[Measurement]:
    """What is seen of a leader by a follower abreast, in the world or by range and bearing."""
    base, rows = 1_000_000_000, rows_of(Measurement, len(path.t))
    speeds = path.v + BESIDE * path.u
    for k, (t, x, y, _, heading, u) in enumerate(np.column_stack(path).tolist()):
        capture_ns, motion = base + round(t * 1e9), FollowerMotion(float(speeds[k]), u, 0.002, 0.01)
        follower = Pose(x + BESIDE * math.sin(heading), y - BESIDE * math.cos(heading), wrapped(heading))
        if len(sigma) == 1:
            dx, dy = sigma[0] * generator.standard_normal(2)
            noise = PoseNoise(sigma[0], 0.0035)
            store(rows, k, measure_world(capture_ns, (x + dx, y + dy), follower, noise, motion))
        else:
            off, turned = generator.standard_normal(2)
            rho, alpha2 = BESIDE + sigma[0] * off, 0.5 * math.pi + sigma[1] * turned
            store(rows, k, measure_body(capture_ns, rho, alpha2, sigma[0], sigma[1], motion))
    return rows


def rules_for(kind: Kind, how: str, told: tuple[float, float] = (0.5, 0.01)) -> Rules:
    front_end = "world" if len(kind.sigma) == 1 else "body"
    told_noise = (
        {"estimator.sigma_position": kind.sigma[0]}
        if len(kind.sigma) == 1
        else {"estimator.sigma_range": kind.sigma[0], "estimator.sigma_bearing": kind.sigma[1]}
    )
    return rules_of(
        load_scenario(
            "turtlebot3",
            {
                "leader.v_eps": V_EPS,
                "leader.k_v": K_V,
                "leader.k_u": kind.k_u,
                "estimator.front_end": front_end,
                "estimator.process_noise": how,
                "estimator.turn_bandwidth": told[0],
                "estimator.speed_bandwidth": told[1],
                "leader.program": {"kind": "constant", "v": 0.08, "u": 0.0},
                **told_noise,
            },
        )
    )


class Score(NamedTuple):
    """Of one run, for each of NAMES: RMSE, NEES, share beyond five deviations; then the share that tracks."""

    rmse: FloatArray
    nees: FloatArray
    beyond: FloatArray
    tracking: float


def scored(rules: Rules, seen: Rows[Measurement], path: Driven, since: float) -> Score:
    estimates = rows_of(Estimate, len(path.t))
    followed(
        row_of(rules),
        row_of(NOTHING_KNOWN),
        rows_of(TrackPoint, _ROOM),
        rows_of(MotionSample, 2),
        rows_of(OwnPoint, 2),
        rows_of(WayEntry, 2),
        rows_of(Member, BANK),
        seen,
        estimates,
    )
    rows = columns_of(estimates)
    turned = rows["alpha1"] + 0.5 * math.pi
    errors = np.stack([rows["v1"] - path.v, np.arctan2(np.sin(turned), np.cos(turned)), rows["u1"] - path.u])
    variances = np.stack([rows["joint"][name] for name in ("v_v", "b_b", "u_u")])
    late = path.t >= since
    tracks = late & (rows["status"] == TRACKING)
    errors, variances = errors[:, tracks], variances[:, tracks]
    ratio = errors**2 / variances
    rmse = np.sqrt(np.mean(errors**2, axis=1))
    return Score(rmse, ratio.mean(axis=1), np.mean(ratio > 25.0, axis=1), float(tracks.sum() / late.sum()))


def shown(label: str, scores: list[Score], than: list[Score] | None) -> None:
    rmse = np.sqrt(np.mean([score.rmse**2 for score in scores], axis=0))
    nees = np.median([score.nees for score in scores], axis=0)
    beyond = np.mean([score.beyond for score in scores], axis=0)
    ratios = np.full(len(NAMES), math.nan)
    if than is not None:
        ratios = rmse / np.sqrt(np.mean([score.rmse**2 for score in than], axis=0))
    tracking = np.mean([score.tracking for score in scores])
    for k, name in enumerate(NAMES):
        first = f"{label if k == 0 else '':30}{name:8}{rmse[k]:9.4f}{ratios[k]:8.2f}"
        print(f"{first}{nees[k]:8.2f}{beyond[k]:9.4f}" + (f"{tracking:9.3f}" if k == 0 else ""))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--only", nargs="*", default=list(KINDS), choices=list(KINDS))
    given = parser.parse_args()
    print(f"{'':30}{'':8}{'RMSE':>9}{'ratio':>8}{'NEES':>8}{'beyond':>9}{'tracking':>9}")
    for name in given.only:
        kind = KINDS[name]
        t = np.arange(round(kind.duration * kind.rate)) / kind.rate
        ways = {"given": rules_for(kind, "given"), "estimated": rules_for(kind, "estimated")}
        if kind.told is not None:
            ways = {"told its own": rules_for(kind, "given", kind.told)} | ways
        scores: dict[str, list[Score]] = {way: [] for way in ways}
        for seed in range(given.runs):
            generator = np.random.default_rng(seed)
            path = kind.drive(generator, t)
            seen = measured(generator, path, kind.sigma)
            for way, rules in ways.items():
                scores[way].append(scored(rules, seen, path, kind.since))
        for way in ways:
            shown(f"{name}, {way}", scores[way], scores.get("told its own"))


if __name__ == "__main__":
    main()
