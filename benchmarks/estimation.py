"""How close every estimator comes to the posterior Cramer-Rao bound, on leaders drawn from the rule's prior.

    python benchmarks/estimation.py [--quick] [--seeds 64] [--duration 4] [ESTIMATOR ...]

World front end at 120 Hz, TurtleBot3 limits, the follower on a circle. Printed for each cell of mocap noise:
RMSE / bound of v1 and alpha1, mean NIS (ideal 2), share of errors of v1 and alpha1 within three of the
estimate's own standard deviations, time of one prediction with update. Judged from 1.5 s on. ``smoother``
knows the whole log, so that it may fall below the bound, which is one for filters.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.random_leaders import random_leader
from estimation.consistency.cramer_rao import TruePath, cramer_rao
from estimation.filters.belief import Model
from estimation.filters.estimators import ESTIMATORS, make_estimator
from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian, nis_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, mean_motion
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_world
from estimation.models.motion import Matrix
from estimation.tracking.estimate import estimate_of
from estimation.tracking.smoother import smooth
from estimation.tracking.track import Tracker, as_filter
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.track_settings import TrackSettings, gate_of
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import shape_of

DT_NS = 8_333_333
DT = DT_NS * 1e-9
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.22, k_u=0.7)
MODEL = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
SD_V2, SD_U2 = 2e-3, 1e-2
POSITIONS = (3e-4, 1e-3, 5e-3)
HEADINGS = (math.radians(0.2), math.radians(1.0))
JUDGED_FROM = 1.5
EVERY = 6  # errors of neighbouring frames tell the same
SMOOTHER = "smoother"


@dataclass
class Score:
    """What an estimator did in one cell: squares of errors and of bounds, NIS, hits within three sigma."""

    errors: list[tuple[float, float]] = field(default_factory=list)
    bounds: list[tuple[float, float]] = field(default_factory=list)
    covered: list[tuple[bool, bool]] = field(default_factory=list)
    nis: list[float] = field(default_factory=list)
    seconds: float = 0.0
    steps: int = 0

    def row(self) -> str:
        ratio = np.sqrt(np.mean(np.square(self.errors), axis=0) / np.mean(np.square(self.bounds), axis=0))
        covered = float(np.mean(self.covered))
        pace = 1e6 * self.seconds / max(1, self.steps)
        return f"{ratio[0]:9.3f} {ratio[1]:9.3f} {np.mean(self.nis):7.3f} {covered:9.4f} {pace:8.1f}"


@dataclass(frozen=True)
class Run:
    """One leader as it drove, what was measured of it, and the least errors possible at the judged frames."""

    seen: list[Measurement]
    truth: list[tuple[float, float]]
    least: list[tuple[float, float]]
    judged: list[int]


def drawn_leader(generator: np.random.Generator, steps: int) -> Matrix:
    """States (steps, 5) of a leader that moves as the model's own process noise says."""
    heading, speed = generator.uniform(-math.pi, math.pi), generator.uniform(0.5, 1.0) * LIMITS.k_v
    turn = generator.uniform(-LIMITS.k_u, LIMITS.k_u)
    state = np.array([0.0, 0.0, speed * math.cos(heading), speed * math.sin(heading), turn])
    return random_leader(generator, state, steps, DT, MODEL.noise)


def drive(generator: np.random.Generator, noise: PoseNoise, steps: int) -> Run:
    """A random leader, followed on a circle that passes some half a metre beside where it starts."""
    leader, own, pose = drawn_leader(generator, steps), Motion(0.15, 0.3), Pose(0.3, -0.5, 0.4)
    poses, seen, truth = [], [], []
    for k, state in enumerate(leader):
        x, y, fx, fy, turned, v, u = (
            generator.standard_normal(7) * ([noise.position] * 4 + [noise.heading, SD_V2, SD_U2])
        ).tolist()
        at = (float(state[0]), float(state[1]))
        measured = Pose(pose.x + fx, pose.y + fy, wrap(pose.theta + turned))
        motion = FollowerMotion(own.v + v, own.u + u, SD_V2, SD_U2)
        seen.append(measure_world(k * DT_NS, (at[0] + x, at[1] + y), measured, noise, motion))
        heading = math.atan2(state[3], state[2])
        truth.append((math.hypot(state[2], state[3]), shape_of(Pose(*at, heading), pose).alpha1))
        poses.append((pose.x, pose.y, pose.theta))
        pose = advance(pose, own.v, own.u, DT)
    judged = list(range(round(JUDGED_FROM / DT), steps, EVERY))
    wanted = np.zeros(steps, dtype=np.bool_)
    wanted[judged] = True
    motions = np.tile([own.v, own.u], (steps, 1))
    times = DT_NS * np.arange(steps, dtype=np.int64)
    path = TruePath(times, leader, np.array(poses), motions, np.ones(steps, dtype=np.bool_))
    bound = cramer_rao(path, MODEL, noise, SD_V2, SD_U2, wanted)
    least = [(float(bound["v1"][k]), float(bound["alpha1"][k])) for k in range(steps)]
    return Run(seen, truth, least, judged)


def filtered(of: Filter, run: Run, score: Score) -> Iterator[Gaussian]:
    """Beliefs of a filter frame by frame, its NIS and its time put on the score. No gate."""
    belief, last = of.start(run.seen[0]), run.seen[0]
    yield belief
    for k, measurement in enumerate(run.seen[1:], start=1):
        follower = mean_motion(last.motion, measurement.motion)
        begun = time.perf_counter()
        prior = of.predict(belief, DT, follower)
        belief = of.update(prior, measurement)
        score.seconds += time.perf_counter() - begun
        score.steps += 1
        if k * DT >= JUDGED_FROM:
            score.nis.append(nis_of(prior, measurement.x, measurement.y, measurement.spread))
        last = measurement
        yield belief


def smoothed(run: Run, score: Score) -> Iterator[Gaussian]:
    """Beliefs of the smoother; the NIS is that of its forward pass."""
    begun = time.perf_counter()
    points = smooth(Tracker(make_estimator("ekf", MODEL), TrackSettings(gate=gate_of(1 - 1e-15))), run.seen)
    score.seconds += time.perf_counter() - begun
    score.steps += len(points)
    score.nis += [point.nis for point in points[run.judged[0] :]]
    return (point.belief for point in points)


def judge(kind: str, run: Run, score: Score) -> None:
    if kind == SMOOTHER:
        beliefs = list(smoothed(run, score))
    else:
        beliefs = list(filtered(as_filter(make_estimator(kind, MODEL)), run, score))
    for k in run.judged:
        found = estimate_of(beliefs[k], run.seen[k], Status.TRACKING, math.nan, 0, NO_JUMP)
        (v1, alpha1), (_, _, sd_v1, sd_alpha1, _) = run.truth[k], np.sqrt(np.diag(found.covariance)).tolist()
        errors = found.v1 - v1, wrap(found.alpha1 - alpha1)
        score.errors.append(errors)
        score.bounds.append(run.least[k])
        score.covered.append((abs(errors[0]) <= 3.0 * sd_v1, abs(errors[1]) <= 3.0 * sd_alpha1))


def main() -> None:
    parser = argparse.ArgumentParser(description="RMSE of the estimators over the posterior Cramer-Rao bound")
    known = [*ESTIMATORS, SMOOTHER]
    parser.add_argument("estimators", nargs="*", metavar="ESTIMATOR", help=f"of: {', '.join(known)}")
    parser.add_argument("--seeds", type=int, default=64, help="leaders in each cell (default 64)")
    parser.add_argument("--duration", type=float, default=4.0, help="seconds of each run (default 4)")
    parser.add_argument("--quick", action="store_true", help="8 leaders in each cell")
    given = parser.parse_args()
    kinds = given.estimators or known
    if unknown := [kind for kind in kinds if kind not in known]:
        parser.error(f"unknown estimator {unknown[0]!r}, expected some of: {', '.join(known)}")
    if given.duration < JUDGED_FROM + 0.5:
        parser.error(f"--duration {given.duration:g}: expected at least {JUDGED_FROM + 0.5:g}")
    seeds, steps = 8 if given.quick else given.seeds, round(given.duration / DT)
    print(f"{seeds} leaders of {given.duration:g} s in each cell, judged from {JUDGED_FROM:g} s on")
    print(f"{'mm':>4} {'deg':>4}  {'estimator':13} v1/bound alpha1/bd     NIS  in 3 sd  us/step")
    for position in POSITIONS:
        for heading in HEADINGS:
            noise = PoseNoise(position, heading)
            runs = [drive(np.random.default_rng([seed, 1]), noise, steps) for seed in range(seeds)]
            for kind in kinds:
                score = Score()
                for run in runs:
                    judge(kind, run, score)
                print(
                    f"{1e3 * position:4.1f} {math.degrees(heading):4.1f}  {kind:12} {score.row()}", flush=True
                )


if __name__ == "__main__":
    main()
