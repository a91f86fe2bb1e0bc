"""A search for leaders and wrong beliefs that drive a pair out of its proved sets with errors.

    python benchmarks/error_adversary.py [--pairs 10000] [--robots 1000] [--duration 30] [--seed 1]

First the set on the manifold alpha2 = pi/2, then the joint set of rho, alpha1 and alpha2, for an error one
percent below the largest for which it closes: pairs begin anywhere in it, alpha2 off by up to its radius.
The first line of each is the model that the proof is about. Then robots: motors lag, commands are truncated,
alone and together, without limits of speed and within the robots'. How far these get out of the set is what
the proofs leave out; ``lost``: passed each other or drifted apart.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.angles import FloatArray
from formation.error_set import error_set
from formation.error_set_kernels import ErrorModel
from formation.invariant_set import InvariantSet
from formation.joint_set import Aside, JointSet, joint_set, largest_error
from formation.shape import ABREAST_ALPHA1
from formation.spacing import restoring

TURTLEBOT3 = ErrorModel(1.5, 0.2, 20.0, 0.08, 0.7, 0.020494)
STEP = 0.01
SLACK = 1e-5
_PLACES = 24
_HOLD = 3
_LOST = 3.0


@dataclass(frozen=True, slots=True)
class Robots:
    """What the reduced model leaves out: mu2 [rad/s], lag [s], what commands are truncated to, limits.

    Without lag the system (3) itself, under laws (4) and (8).
    """

    mu2: float = 2.0
    lag: float = 0.1
    resolution: float = 0.01
    v_max: float = math.inf
    u_max: float = math.inf


Held = InvariantSet | JointSet


@dataclass(frozen=True, slots=True)
class Came:
    """How many pairs ever left, how far the worst of those that are not lost, and how near the edge any came.

    ``excess``: in rho [m] and alpha1 [rad], beyond the extremes of the set. ``reached``: the largest share of
    the way from the equilibrium to an extreme.
    """

    pairs: int
    left: int
    lost: int
    excess_rho: float
    excess_alpha1: float
    reached: float


class _Pairs:
    """Many pairs with their leaders' choices: half by chance, half whatever hurts now, after a margin."""

    def __init__(self, model: ErrorModel, inside: Held, random: np.random.Generator, n: int) -> None:
        self.model, self._random = model, random
        self.rho = random.uniform(inside.rho_min, inside.rho_max, n)
        self.theta = random.uniform(*inside.span(self.rho)) - ABREAST_ALPHA1
        self.epsilon, self.v2, self.u2 = np.zeros(n), np.full(n, math.nan), np.zeros(n)
        self._across = np.zeros(n, dtype=np.bool_)
        if isinstance(inside, JointSet):
            share = np.clip(random.uniform(-1.5, 1.5, n), -1.0, 1.0)
            self.epsilon = share * inside.radius(self.rho)
            # Some do nothing but move alpha2, while their leaders do what hurts.
            self._across = random.random(n) < 0.25
        self._cunning = random.random(n) < 0.7
        self._margin = random.uniform(0.0, 0.2, n) * (random.random(n) < 0.8)
        self._rate = 1.0 / np.exp(random.uniform(math.log(0.05), math.log(10.0), n))
        self.place, self.u1 = random.uniform(0.0, 2.0 * math.pi, n), model.k_u * random.choice([-1.0, 1.0], n)

    def choose(self) -> None:
        """Errors on the rim and steering at the limit for the next step."""
        n, random, k_u = len(self.rho), self._random, self.model.k_u
        places: FloatArray = np.linspace(0.0, 2.0 * math.pi, _PLACES, endpoint=False)
        side = np.where(self.theta >= 0.0, 1.0, -1.0)
        values = side[:, np.newaxis] * self._pull(places[np.newaxis, :])
        worst = places[np.argmax(values, axis=1)]
        hurts = self._cunning & (np.abs(self.theta) >= self._margin)
        by_chance = (random.random(n) < _HOLD * STEP * self._rate) & ~self._cunning
        drawn = random.uniform(0.0, 2.0 * math.pi, n)
        self.place = np.where(hurts, worst, np.where(by_chance, drawn, self.place))
        aside = 0.5 * math.pi * np.where(self.place % (2.0 * math.pi) < math.pi, 1.0, -1.0)
        self.place = np.where(self._across & ~hurts, aside, self.place)
        self.u1 = np.where(hurts, -side * k_u, np.where(by_chance, -self.u1, self.u1))

    def believed(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocity of the leader along and across the line, as it is believed."""
        theta = self.theta if place.ndim == 1 else self.theta[:, np.newaxis]
        v1, wrong = self.model.v1, self.model.W
        return v1 * np.sin(theta) + wrong * np.cos(place), -v1 * np.cos(theta) + wrong * np.sin(place)

    def asked(self, place: FloatArray) -> FloatArray:
        """Speed that law (8) asks for on that belief."""
        x, y = self.believed(place)
        v, rho = np.hypot(x, y), self.rho if place.ndim == 1 else self.rho[:, np.newaxis]
        f = restoring(rho, self.model.rho_0, self.model.mu_rho)
        speed: FloatArray = -y + rho * (-self.model.mu1 * x / v + v * f)
        return speed

    def _pull(self, place: FloatArray) -> FloatArray:
        rho = self.rho if place.ndim == 1 else self.rho[:, np.newaxis]
        return self.asked(place) / rho

    def drive_model(self) -> None:
        """One step of the reduced system; midpoint rule."""
        rho, theta = self.rho, self.theta
        for h in (0.5 * STEP, STEP):
            across = -self.model.v1 * np.cos(self.theta)
            rates = -self.model.v1 * np.sin(self.theta), -self.u1 + across / self.rho + self._pull(self.place)
            self.rho, self.theta = rho + h * rates[0], theta + h * rates[1]

    def drive_whole(self, robots: Robots) -> None:
        """One step of the system (3) under laws (4) and (8), carried out at once; midpoint rule."""
        rho, theta, epsilon = self.rho, self.theta, self.epsilon
        for h in (0.5 * STEP, STEP):
            v2 = np.clip(self.asked(self.place), -robots.v_max, robots.v_max)
            sine, cosine = np.cos(self.epsilon), -np.sin(self.epsilon)
            _, believed = self.believed(self.place)
            x, y = self.model.v1 * np.sin(self.theta), -self.model.v1 * np.cos(self.theta)
            turn = (y + v2 * sine) / self.rho
            u2 = -robots.mu2 * cosine + (believed + v2 * sine) / self.rho
            rates = -x - v2 * cosine, turn - self.u1, turn - np.clip(u2, -robots.u_max, robots.u_max)
            self.rho = np.clip(rho + h * rates[0], 1e-2, 10.0)
            self.theta, self.epsilon = theta + h * rates[1], epsilon + h * rates[2]

    def drive_robots(self, robots: Robots) -> None:
        """One step with motors that lag behind truncated commands."""
        sine, cosine = np.cos(self.epsilon), -np.sin(self.epsilon)
        v2 = np.clip(self.asked(self.place), -robots.v_max, robots.v_max)
        _, y = self.believed(self.place)
        u2 = -robots.mu2 * cosine + (y + v2 * sine) / self.rho
        cut = robots.resolution
        u2 = np.clip(u2, -robots.u_max, robots.u_max)
        wanted = (np.trunc(v2 / cut) * cut, np.trunc(u2 / cut) * cut) if cut > 0.0 else (v2, u2)
        keeps = math.exp(-STEP / robots.lag) if robots.lag > 0.0 else 0.0
        first = np.isnan(self.v2)
        self.v2 = np.where(first, v2, wanted[0] + (self.v2 - wanted[0]) * keeps)
        self.u2 = np.where(first, u2, wanted[1] + (self.u2 - wanted[1]) * keeps)
        x, y = self.model.v1 * np.sin(self.theta), -self.model.v1 * np.cos(self.theta)
        turn = (y + self.v2 * sine) / self.rho
        self.rho = np.clip(self.rho + STEP * (-x - self.v2 * cosine), 1e-2, 10.0)
        self.theta = self.theta + STEP * (turn - self.u1)
        self.epsilon = self.epsilon + STEP * (turn - self.u2)


def drive_out(
    model: ErrorModel,
    inside: Held,
    random: np.random.Generator,
    pairs: int,
    duration: float,
    robots: Robots | None = None,
) -> Came:
    """Let leaders and errors try for ``duration`` [s], from anywhere in the set."""
    tried = _Pairs(model, inside, random, pairs)
    left: NDArray[np.bool_] = np.zeros(pairs, dtype=np.bool_)
    lost = left.copy()
    excess, reached = np.zeros((2, pairs)), 0.0
    low, high = inside.alpha1_min - ABREAST_ALPHA1, inside.alpha1_max - ABREAST_ALPHA1
    for step in range(round(duration / STEP)):
        if step % _HOLD == 0:
            tried.choose()
        if robots is None:
            tried.drive_model()
        elif robots.lag == 0.0 and robots.resolution == 0.0:
            tried.drive_whole(robots)
        else:
            tried.drive_robots(robots)
        rho, theta = tried.rho, tried.theta
        left |= ~inside.contains(rho, theta + ABREAST_ALPHA1, SLACK)
        lost |= (np.abs(theta) > math.pi) | (rho > _LOST) | (rho < 0.02)
        excess[0] = np.maximum(excess[0], np.maximum(inside.rho_min - rho, rho - inside.rho_max))
        excess[1] = np.maximum(excess[1], np.maximum(low - theta, theta - high))
        shares = (
            (rho - model.rho_0) / (inside.rho_max - model.rho_0),
            (model.rho_0 - rho) / (model.rho_0 - inside.rho_min),
        )
        # A pair that began near the edge has shown nothing: what counts is where it is at the end of a while.
        if step * STEP > 0.3 * duration:
            reached = max(reached, *(float(share[~lost].max(initial=0.0)) for share in shares))
    kept = excess[:, ~lost]
    return Came(
        pairs,
        int(np.count_nonzero(left)),
        int(np.count_nonzero(lost)),
        float(kept[0].max(initial=0.0)),
        float(kept[1].max(initial=0.0)),
        reached,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--robots", type=int, default=1_000)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--W", type=float, default=TURTLEBOT3.W)
    given = parser.parse_args()
    model = TURTLEBOT3._replace(W=given.W)
    plane = error_set(model)
    if plane is None:
        print(f"no set is proved for W = {given.W} m/s")
        return
    _try_out("on the manifold", model, plane.inside, given, None)
    robots = Robots()
    smaller = model._replace(W=0.99 * largest_error(model, Aside(robots.mu2)))
    joint = joint_set(smaller, Aside(robots.mu2))
    if joint is None:
        print("no joint set is proved")
        return
    _try_out(f"jointly, alpha2 within {joint.alpha2_within:.4f} rad,", smaller, joint, given, WHOLE)


WHOLE = Robots(lag=0.0, resolution=0.0)


def _try_out(
    name: str, model: ErrorModel, inside: Held, given: argparse.Namespace, first: Robots | None
) -> None:
    print(
        f"proved {name} for W = {model.W:g} m/s: rho {inside.rho_min:.5f} to {inside.rho_max:.5f} m, "
        f"alpha1 {inside.alpha1_min:.4f} to {inside.alpha1_max:.4f} rad"
    )
    rows = [
        ("the assumed model", given.pairs, first),
        ("alpha2 moves", given.robots, WHOLE),
        ("truncation alone", given.robots, Robots(lag=0.0)),
        ("lag of 0.02 s alone", given.robots, Robots(lag=0.02, resolution=0.0)),
        ("lag of 0.1 s alone", given.robots, Robots(resolution=0.0)),
        ("lag and truncation", given.robots, Robots()),
        ("limits alone", given.robots, Robots(lag=0.0, resolution=0.0, v_max=0.22, u_max=2.84)),
        ("all of it", given.robots, Robots(v_max=0.22, u_max=2.84)),
    ]
    for row, pairs, robots in rows:
        if row == "alpha2 moves" and first is not None:
            continue
        came = drive_out(model, inside, np.random.default_rng(given.seed), pairs, given.duration, robots)
        print(
            f"  {row:<24} {came.pairs} pairs: {came.left} left the set, {came.lost} lost, excess "
            f"{came.excess_rho:.4f} m, {came.excess_alpha1:.4f} rad, reached {came.reached:.1%} of the way",
            flush=True,
        )


if __name__ == "__main__":
    main()
