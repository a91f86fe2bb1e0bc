"""Do the bounds hold that estimates go out with? Leaders and noise at their limits, in the worst patterns.

    python benchmarks/live_bounds.py [--samples 10000000] [--scenario turtlebot3] [--seed 1]

Tracks of 2000 frames go through the very step that flies. Leaders accelerate by k_v k_u, to and fro; each
axis of every measured position errs by three standard deviations, its signs switched by chance, in square
waves of all periods, or by the impulse response of the filter turned round in time, which is the pattern that
leads it furthest astray. Of the tracking rows: how many errors exceed their bounds, the largest error over
its bound, medians of the bounds, and how many of alpha1 exclude anything.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.bounds.filter_response import FlyingFilter, error_dynamics
from estimation.bounds.window_velocity import window_velocity
from estimation.models.measurement import PairSeen
from estimation.tracking.tracker import TRACKING
from formation.angles import FloatArray, wrap
from formation.kernel import entry
from formation.lending import lent
from formation.pose import Pose
from formation.records import Matrix, Rows, load
from hil.nodes import estimator_step as step
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import Desk, NodeRules, forget
from hil.nodes.estimator_records import Known
from hil.scenario.files import load_scenario
from hil.scenario.leader_model import leader_limits, process_noise
from hil.scenario.schema import Scenario
from hil.wire.assumed_errors import bounds_of

FRAMES = 2000
SIGMAS = 3.0


@entry
def fold(desks: Rows[Desk], start_ns: int, period_ns: int, frames: Matrix, found: Matrix) -> None:
    """Fold the frames (5, n) of a pair into a new track; v1, alpha1, bounds and status (6, n) of each."""
    desk = load(Desk, desks, 0)
    rules = load(NodeRules, desk.rules, 0)
    forget(desk)
    for k in range(frames.shape[1]):
        capture_ns = start_ns + k * period_ns
        seen = PairSeen(frames[0, k], frames[1, k], Pose(frames[2, k], frames[3, k], frames[4, k]))
        step.take_frame(desk.known, desk.memory(), rules.step, capture_ns, seen)
        known = load(Known, desk.known, 0)
        told = step.estimate(known, desk.points, rules.step, capture_ns).estimate
        window = window_velocity(desk.points, known.track, rules.assumed.positions.longest)
        bound = bounds_of(told, rules.assumed, window)
        found[0, k], found[1, k], found[5, k] = told.v1, told.alpha1, float(told.status)
        found[2, k], found[3, k], found[4, k] = bound.v1, bound.alpha1, bound.h


class Adversary:
    """Draws leaders and noise at the limits of a scenario."""

    def __init__(self, scenario: Scenario, random: np.random.Generator) -> None:
        self._random, self._given = random, scenario
        self.period_ns = round(1e9 / scenario.mocap.rate_hz)
        limits = leader_limits(scenario)
        self._limits, self._A = limits, limits.k_v * limits.k_u
        flying = FlyingFilter(
            scenario.estimator.sigma_position, self.period_ns * 1e-9, process_noise(scenario), limits
        )
        self._patterns = [_signs(flying, v1) for v1 in np.linspace(limits.v_eps, limits.k_v, 4).tolist()]

    def leader(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Positions and velocities (n,), as complex numbers: arcs as hard as the acceleration allows."""
        random, h = self._random, self.period_ns * 1e-9
        v1 = float(random.uniform(self._limits.v_eps, self._limits.k_v))
        turn = self._A / v1 * self._square(random.uniform(0.05, 3.0), h)
        heading = random.uniform(-math.pi, math.pi) + np.concatenate([[0.0], np.cumsum(turn[:-1] * h)])
        half = 0.5 * turn * h
        chords = v1 * h * np.sinc(half / math.pi) * np.exp(1j * (heading + half))
        velocities = np.asarray(v1 * np.exp(1j * heading), dtype=np.complex128)
        return np.concatenate([[0j], np.cumsum(chords[:-1])]), velocities

    def noise(self) -> NDArray[np.complex128]:
        """Errors (n,) of positions, as complex numbers, each axis at its limit."""
        random, limit = self._random, SIGMAS * self._given.estimator.sigma_position
        kind = random.integers(3)
        signs: list[FloatArray]
        if kind == 0:
            signs = [random.choice(np.array([-1.0, 1.0]), FRAMES) for _ in range(2)]
        elif kind == 1:
            hold = random.uniform(0.01, 0.6)
            signs = [self._square(hold, self.period_ns * 1e-9) for _ in range(2)]
            signs[1] = signs[0] * random.choice([-1.0, 1.0]) if random.random() < 0.5 else signs[1]
        else:
            pattern = self._patterns[random.integers(len(self._patterns))]
            length = int(random.integers(10, len(pattern)))
            repeated = np.tile(pattern[-length:], FRAMES // length + 1)[:FRAMES]
            signs = [repeated * random.choice([-1.0, 1.0]) for _ in range(2)]
        return np.asarray(limit * (signs[0] + 1j * signs[1]), dtype=np.complex128)

    def _square(self, hold: float, h: float) -> FloatArray:
        """Signs (n,) that switch after ``hold`` [s], sharply or by chance."""
        if self._random.random() < 0.5:
            return np.where((np.arange(FRAMES) * h / hold).astype(int) % 2 == 0, 1.0, -1.0)
        flips = np.where(self._random.random(FRAMES) < h / hold, -1.0, 1.0)
        return np.asarray(np.cumprod(flips), dtype=np.float64)


def _signs(flying: FlyingFilter, v1: float) -> FloatArray:
    """Signs of the weights of past noise in the velocity across the leader's way, the oldest first."""
    dynamics = error_dynamics(flying, v1, 0.0)
    weight, weights = dynamics.K[:, 1], []
    for _ in range(200):
        weights.append(float(weight[3]))
        weight = dynamics.M @ weight
    return np.asarray(np.sign(weights[::-1]), dtype=np.float64)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--scenario", default="turtlebot3")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    scenario = load_scenario(given.scenario, ["estimator.own_motion=mocap"])
    judged, broken, tight, bounds, seconds = judge(scenario, given.samples, given.seed)
    says = np.mean(bounds[1] < math.pi)
    print(f"{judged} tracking samples in {seconds:.0f} s, in the worst patterns:")
    for name, count, share, bound in zip(("v1", "alpha1"), broken, tight, bounds, strict=True):
        median = np.median(bound)
        print(f"  {name:<7} {count} beyond the bound, error / bound up to {share:.3f}, median {median:.4f}")
    print(f"  alpha1 bounded below pi in {says:.2%}")


def judge(
    scenario: Scenario, samples: int, seed: int
) -> tuple[int, list[int], list[float], list[FloatArray], float]:
    """Samples judged; per v1 and alpha1 violations, largest error / bound, every 20th bound; seconds."""
    random = np.random.default_rng(seed)
    adversary, node = Adversary(scenario, random), EstimatorNode(scenario)
    memory = node.begin(0).memory
    desks = lent(memory.desk)
    broken, tight, judged = [0, 0], [0.0, 0.0], 0
    kept: list[list[FloatArray]] = [[], []]
    found, began = np.zeros((6, FRAMES)), time.perf_counter()
    while judged < samples:
        places, velocities = adversary.leader()
        around = scenario.formation.rho_0 * random.uniform(0.7, 2.0)
        line = around * velocities / np.abs(velocities) * np.exp(-1j * random.uniform(-math.pi, math.pi))
        own = places + line
        seen, own_seen = places + adversary.noise(), own + adversary.noise()
        frames = np.stack([seen.real, seen.imag, own_seen.real, own_seen.imag, np.angle(velocities)])
        fold(desks, 10**9, adversary.period_ns, frames, found)
        alpha1 = np.angle(line / velocities)
        tracking = found[5] == TRACKING
        errors = np.abs(found[0] - np.abs(velocities)), np.abs(wrap(found[1] - alpha1))
        for k, error in enumerate(errors):
            bound = found[2 + k]
            broken[k] += int(np.count_nonzero((error > bound + 1e-12) & tracking))
            tight[k] = max(tight[k], float((error / bound)[tracking].max(initial=0.0)))
            kept[k].append(bound[tracking][::20].copy())
        judged += int(np.count_nonzero(tracking))
    return judged, broken, tight, [np.concatenate(each) for each in kept], time.perf_counter() - began


if __name__ == "__main__":
    main()
