"""How long it takes from no knowledge at all until the leader is known, and whether it ever fails to.

    python benchmarks/acquisition.py [--starts 1000] [--estimator ekf]

A leader of random speed and turn rate is anywhere around the follower, 0.2 to 2 m away; nothing tells the
estimator its heading. Its speed and turn rate wander as the rule's prior says, and turn back where they would
leave the limits that the estimator is told (v_eps to k_v, k_u). In the rows "beyond" they go on: within 6 s
nine in ten turn harder than k_u, some four times so, or are slower than v_eps. Sensors: mocap at 120 Hz
(0.3 mm, 0.2 deg), and at 10 Hz with 25 mm and 0.02 rad mocap (world front end) or range and bearing (body
front end, noisy odometry).

Settled is the first estimate with status TRACKING whose v1 and alpha1 are within five of its own standard
deviations, if all later ones marked TRACKING are, too. A start diverges if the last estimate marked TRACKING
is outside of that, and is wrong for a while if any is; it is astray if any is off by more than a right angle
in alpha1. It has left if it stopped TRACKING after it had settled, other than for single frames outside the
gate: as a leader does that slows down until its direction is no longer known.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.estimation import LIMITS, SD_U2, SD_V2
from estimation.filters.belief import Model
from estimation.filters.estimators import make_estimator, settling
from estimation.models.coordinated_turn import FollowerMotion, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_body, measure_world
from estimation.models.motion import Vector, process_noise, propagate
from estimation.tracking.estimate import estimate_at
from estimation.tracking.track import Tracker
from estimation.tracking.track_settings import TrackSettings
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Pose, advance
from formation.shape import shape_of

NOISE = ProcessNoise.by_rule(LIMITS, 0.5)
SIGMAS = 5.0


@dataclass(frozen=True)
class Sensor:
    """A way to see the leader: rate [Hz], noise of position and heading, or of range and bearing.

    ``within`` [s]: how soon it is to be settled; ``duration`` [s] of a start.
    """

    name: str
    front_end: FrontEnd
    rate: float
    noise: tuple[float, float]
    within: float
    duration: float


SENSORS = (
    Sensor("mocap, 120 Hz, 0.3 mm, 0.2 deg", FrontEnd.WORLD, 120.0, (3e-4, math.radians(0.2)), 1.1, 2.0),
    Sensor("mocap, 10 Hz, 25 mm, 0.02 rad", FrontEnd.WORLD, 10.0, (0.025, 0.02), 3.0, 6.0),
    Sensor("range and bearing, 10 Hz, 25 mm, 0.02 rad", FrontEnd.BODY, 10.0, (0.025, 0.02), 3.0, 6.0),
)


@dataclass(frozen=True)
class Start:
    """``settled`` [s] since the first measurement, nan for never.

    ``wrong``: estimates marked TRACKING whose error was beyond five standard deviations; ``diverged``: the
    last one was; ``astray``: those off by more than a right angle; ``left``: whether it stopped TRACKING.
    """

    settled: float
    wrong: int
    diverged: bool
    astray: int
    left: bool


def tracker_for(sensor: Sensor, kind: str = "ekf") -> Tracker:
    """Tracker with the settings of a live estimator."""
    settings = TrackSettings(**settling(kind)._asdict())
    return Tracker(make_estimator(kind, Model(sensor.front_end, LIMITS, NOISE)), settings)


def start(tracker: Tracker, sensor: Sensor, seed: int, *, beyond: bool = False) -> Start:
    """One start from nothing; ``beyond``: the leader may leave its limits."""
    generator = np.random.default_rng([seed, 3])
    around, away, heading = generator.uniform([-math.pi, 0.2, -math.pi], [math.pi, 2.0, math.pi]).tolist()
    speed, turn = generator.uniform([0.5 * LIMITS.k_v, -LIMITS.k_u], [LIMITS.k_v, LIMITS.k_u]).tolist()
    place = (away * math.cos(around), away * math.sin(around))
    state = np.array([*place, speed * math.cos(heading), speed * math.sin(heading), turn])
    pose, dt_ns = Pose(0.0, 0.0, generator.uniform(-math.pi, math.pi)), round(1e9 / sensor.rate)
    track, settled = tracker.add((), _seen(generator, sensor, 0, state, pose))[0], math.nan
    wrong, astray, diverged, left = 0, 0, False, False
    for k in range(1, round(sensor.duration * sensor.rate)):
        shock = np.linalg.cholesky(process_noise(state, dt_ns * 1e-9, NOISE)) @ generator.standard_normal(5)
        state, pose = propagate(state, dt_ns * 1e-9) + shock, advance(pose, 0.15, 0.3, dt_ns * 1e-9)
        state = state if beyond else _within_limits(state)
        measurement = _seen(generator, sensor, k * dt_ns, state, pose)
        track, _ = tracker.add(track, measurement)
        status = tracker.status(track, k * dt_ns)
        found = estimate_at(track[-1], status)
        truth = shape_of(Pose(state[0], state[1], math.atan2(state[3], state[2])), pose)
        off = abs(found.v1 - math.hypot(state[2], state[3])), abs(wrap(found.alpha1 - truth.alpha1))
        sd = np.sqrt(np.diag(found.covariance))
        near = off[0] <= SIGMAS * sd[2] and off[1] <= SIGMAS * sd[3]
        tracking = status is Status.TRACKING
        wrong += tracking and not near
        astray += tracking and off[1] > 0.5 * math.pi
        diverged = not near if tracking else diverged
        if tracking and not near:
            settled, left = math.nan, False
        elif tracking and math.isnan(settled):
            settled = k * dt_ns * 1e-9
        left |= not math.isnan(settled) and not tracking and status is not Status.REJECTING
    return Start(settled, wrong, diverged, astray, left)


def _within_limits(state: Vector) -> Vector:
    """State whose speed and turn rate are thrown back at the leader's limits."""
    speed, turn = math.hypot(state[2], state[3]), float(state[4])
    kept = 2.0 * min(max(speed, LIMITS.v_eps), LIMITS.k_v) - speed
    turned = 2.0 * min(max(turn, -LIMITS.k_u), LIMITS.k_u) - turn
    return np.array([*state[0:2], *(state[2:4] * (kept / speed)), turned])


def _seen(
    generator: np.random.Generator, sensor: Sensor, at_ns: int, state: np.ndarray, pose: Pose
) -> Measurement:
    shake = generator.standard_normal(7).tolist()
    motion = FollowerMotion(0.15 + SD_V2 * shake[5], 0.3 + SD_U2 * shake[6], SD_V2, SD_U2)
    a, b = sensor.noise
    if sensor.front_end is FrontEnd.WORLD:
        leader = (float(state[0]) + a * shake[0], float(state[1]) + a * shake[1])
        own = Pose(pose.x + a * shake[2], pose.y + a * shake[3], wrap(pose.theta + b * shake[4]))
        return measure_world(at_ns, leader, own, PoseNoise(a, b), motion)
    shape = shape_of(Pose(float(state[0]), float(state[1]), 0.0), pose)
    rho, alpha2 = max(0.01, shape.rho + a * shake[0]), wrap(shape.alpha2 + b * shake[1])
    return measure_body(at_ns, rho, alpha2, a, b, motion)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--estimator", default="ekf")
    given = parser.parse_args()
    print(
        f"{'':43} {'leader':8} starts  settled p50   p99   max [s]  late  never  wrong  diverged  astray left"
    )
    for sensor in SENSORS:
        tracker = tracker_for(sensor, given.estimator)
        for name, beyond in (("within", False), ("beyond", True)):
            starts = [start(tracker, sensor, seed, beyond=beyond) for seed in range(given.starts)]
            print(f"{sensor.name:43} {name:8} {_row(sensor, starts)}", flush=True)


def _row(sensor: Sensor, starts: list[Start]) -> str:
    settled = np.array([each.settled for each in starts if not math.isnan(each.settled)])
    p50, p99, most = np.percentile(settled, [50, 99, 100]).tolist()
    late, never = int(np.count_nonzero(settled > sensor.within)), len(starts) - len(settled)
    wrong, diverged = sum(each.wrong > 0 for each in starts), sum(each.diverged for each in starts)
    astray, left = sum(each.astray > 0 for each in starts), sum(each.left for each in starts)
    times = f"{p50:12.2f} {p99:5.2f} {most:5.2f}"
    return f"{len(starts):6} {times} {late:9} {never:6} {wrong:6} {diverged:9} {astray:7} {left:4}"


if __name__ == "__main__":
    main()
