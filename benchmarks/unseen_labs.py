"""Whether estimates are as wrong as they say, in labs that nobody has tuned anything for.

    python benchmarks/unseen_labs.py [--labs 200] [--seed 1] [--worst 12] [--only steps ...] [--lab N]

Each lab is drawn by chance: size and pace of the robots, rate and noise of the motion capture, how far that
noise is from what is told, lost frames, what the leader does, whether there is odometry and how noisy. All is
estimated by :func:`abreast.estimate` with the defaults. It is told what a lab would tell: the robots' limits,
and a noise that may be wrong by a factor of three. For each quantity: median NEES (mean of e^2 / variance
while tracking) over labs with its deciles, the share of labs within .5 to 2, and the share of samples beyond
five standard deviations. Then the worst labs, each with what it was drawn as.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import abreast
from benchmarks.bandwidths import Driven, driven
from formation.angles import wrap

FloatArray = NDArray[np.float64]

QUANTITIES = ("rho_dot", "alpha2_dot", "v1", "alpha1", "u1")
PROGRAMS = ("straight", "circle", "swings", "slow sines", "stop-and-go", "steps", "chance")
SINCE = 3.0
"""Seconds after which errors count."""


class Lab(NamedTuple):
    """What is drawn: limits of the leader [m/s, rad/s], frames [Hz], noise of places [m] and headings [rad].

    ``off``: true noise over what is told. ``lost``: share of frames. ``lag`` [s] of the robots. ``program``:
    of :data:`PROGRAMS`. ``beside``: whether the follower keeps abreast, or drives by itself. ``wheels``:
    relative noise of odometry, 0 without any.
    """

    k_v: float
    k_u: float
    rate: float
    sigma: float
    sigma_heading: float
    off: float
    lost: float
    lag: float
    program: str
    beside: bool
    wheels: float


class Outcome(NamedTuple):
    """Of each of :data:`QUANTITIES` NEES and share beyond five deviations, and the share that is tracked."""

    nees: FloatArray
    beyond: FloatArray
    tracked: float


def drawn(random: np.random.Generator) -> Lab:
    """A lab by chance."""
    return Lab(
        k_v=_between(random, 0.1, 1.5),
        k_u=_between(random, 0.4, 3.0),
        rate=float(random.choice([10.0, 20.0, 30.0, 50.0, 60.0, 100.0, 120.0, 240.0])),
        sigma=_between(random, 1e-4, 3e-3),
        sigma_heading=_between(random, 1e-3, 1e-2),
        off=float(random.choice([1.0, 1.0, 0.3, 3.0])),
        lost=float(random.choice([0.0, 0.02, 0.1])),
        lag=random.uniform(0.03, 0.3),
        program=str(random.choice(PROGRAMS)),
        beside=bool(random.random() < 0.5),
        wheels=float(random.choice([0.0, 0.01, 0.03])),
    )


def _between(random: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def path_of(lab: Lab, random: np.random.Generator, t: FloatArray) -> Driven:
    """A robot of this lab driving by its program."""
    k_v, k_u = lab.k_v, lab.k_u
    ones, heading = np.ones_like(t), random.uniform(-3.0, 3.0)
    speed = random.uniform(0.5, 0.9) * k_v
    if lab.program == "straight":
        v, u = speed * ones, 0.0 * ones
    elif lab.program == "circle":
        v, u = speed * ones, random.uniform(-0.8, 0.8) * k_u * ones
    elif lab.program == "swings":
        period = random.uniform(2.0, 8.0)
        u = k_u * (random.uniform(-0.2, 0.2) + 0.7 * np.sin(2.0 * math.pi * (t / period + random.random())))
        v = speed * ones
    elif lab.program == "slow sines":
        v = speed + 0.1 * k_v * _sine(random, t)
        u = 0.4 * k_u * _sine(random, t)
    elif lab.program == "stop-and-go":
        period, phase = random.uniform(3.0, 8.0), random.uniform(0.0, 8.0)
        goes = (t + phase) % period < 0.6 * period
        v, u = np.where(goes, speed, 0.0), np.where(goes, 0.4 * k_u * _sine(random, t), 0.0)
    elif lab.program == "steps":
        v, u = _steps(random, t, 0.45 * k_v, k_v), _steps(random, t, -k_u, k_u)
    else:
        v, u = 0.45 * k_v + 0.5 * k_v * _wandering(random, t), k_u * (2.0 * _wandering(random, t) - 1.0)
    return driven(t, v, u, heading, lab.lag)


def _sine(random: np.random.Generator, t: FloatArray) -> FloatArray:
    sine: FloatArray = np.sin(2.0 * math.pi * (t / random.uniform(10.0, 30.0) + random.random()))
    return sine


def _steps(random: np.random.Generator, t: FloatArray, low: float, high: float) -> FloatArray:
    found, k = np.empty_like(t), 0
    while k < len(t):
        n = max(1, round(random.uniform(1.5, 5.0) / (t[1] - t[0])))
        found[k : k + n] = random.uniform(low, high)
        k += n
    return found


def _wandering(random: np.random.Generator, t: FloatArray) -> FloatArray:
    """Between 0 and 1, as an Ornstein-Uhlenbeck process through a sigmoid."""
    keeps, now = math.exp(-(t[1] - t[0]) / random.uniform(0.5, 4.0)), random.normal()
    found = np.empty_like(t)
    for k in range(len(t)):
        now = keeps * now + math.sqrt(1.0 - keeps * keeps) * random.normal()
        found[k] = 1.0 / (1.0 + math.exp(-1.5 * now))
    return found


def followed(lab: Lab, leader: Driven, random: np.random.Generator) -> Driven:
    """The follower: abreast on the leader's right as a rigid body would be, or by itself some way off."""
    if lab.beside:
        beside = 2.0 * lab.k_v
        x = leader.x + beside * np.sin(leader.heading)
        y = leader.y - beside * np.cos(leader.heading)
        return Driven(leader.t, x, y, leader.v + beside * leader.u, leader.heading, leader.u)
    own = path_of(lab, random, leader.t)
    away = 10.0 * lab.k_v
    return own._replace(x=own.x + away, y=own.y - away)


def seen(lab: Lab, number: int, duration: float = 30.0) -> Outcome:
    """Drive, look, estimate and judge."""
    random = np.random.default_rng([number, 7])
    t = np.arange(round(duration * lab.rate)) / lab.rate
    leader = path_of(lab, random, t)
    follower = followed(lab, leader, random)
    n, true_sigma, true_heading = len(t), lab.sigma * lab.off, lab.sigma_heading * lab.off
    places = np.column_stack([leader.x, leader.y]) + true_sigma * random.standard_normal((n, 2))
    poses = np.column_stack([follower.x, follower.y, follower.heading])
    poses += random.standard_normal((n, 3)) * [true_sigma, true_sigma, true_heading]
    places[random.random(n) < lab.lost] = math.nan
    v2 = u2 = None
    if lab.wheels > 0.0:
        v2 = follower.v + lab.wheels * lab.k_v * random.standard_normal(n)
        u2 = follower.u + lab.wheels * lab.k_u * random.standard_normal(n)
    told = {
        "leader.v_eps": 0.4 * lab.k_v,
        "leader.k_v": lab.k_v,
        "leader.k_u": lab.k_u,
        "leader.program.v": 0.7 * lab.k_v,
        "mocap.rate_hz": lab.rate,
        "controller.v_max": 3.0 * lab.k_v,
        "controller.u_max": 3.0 * lab.k_u,
        "estimator.sigma_position": lab.sigma,
        "estimator.sigma_heading": lab.sigma_heading,
        "estimator.sigma_v2": max(lab.wheels, 0.01) * lab.k_v,
        "estimator.sigma_u2": max(lab.wheels, 0.01) * lab.k_u,
    }
    scenario = abreast.load_scenario("turtlebot3", told)
    found = abreast.estimate(t, places, poses, scenario=scenario, v2=v2, u2=u2)
    return judged(found, leader, follower)


def judged(found: abreast.Estimates, leader: Driven, follower: Driven) -> Outcome:
    """Errors by their reported variances, while tracking a leader that moves."""
    truth = true_columns(leader, follower)
    tracks = (found.status == "tracking") & (found.t - found.t[0] >= SINCE)
    nees, beyond = np.full(len(QUANTITIES), math.nan), np.full(len(QUANTITIES), math.nan)
    if tracks.sum() > 20:
        for k, name in enumerate(QUANTITIES):
            off = getattr(found, name) - truth[name]
            off = wrap(off) if name == "alpha1" else off
            ratio = (off[tracks] / getattr(found, f"sd_{name}")[tracks]) ** 2
            nees[k], beyond[k] = ratio.mean(), np.mean(ratio > 25.0)
    moves = (found.t - found.t[0] >= SINCE) & (leader.v > 0.4 * leader.v.max())
    return Outcome(nees, beyond, float((tracks & moves).sum() / max(1, moves.sum())))


def true_columns(leader: Driven, follower: Driven) -> dict[str, FloatArray]:
    """True values by :data:`QUANTITIES`."""
    dx, dy = leader.x - follower.x, leader.y - follower.y
    rho, line = np.hypot(dx, dy), np.arctan2(dy, dx)
    vx = leader.v * np.cos(leader.heading) - follower.v * np.cos(follower.heading)
    vy = leader.v * np.sin(leader.heading) - follower.v * np.sin(follower.heading)
    return {
        "rho_dot": (dx * vx + dy * vy) / rho,
        "alpha2_dot": (dx * vy - dy * vx) / rho**2 - follower.u,
        "v1": leader.v,
        "alpha1": line + math.pi - leader.heading,
        "u1": leader.u,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--labs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worst", type=int, default=12)
    parser.add_argument("--only", nargs="*", choices=PROGRAMS)
    parser.add_argument("--lab", type=int, help="this one alone")
    given = parser.parse_args()
    labs = [drawn(np.random.default_rng([given.seed, k])) for k in range(given.labs)]
    chosen = [k for k, lab in enumerate(labs) if not given.only or lab.program in given.only]
    chosen = chosen if given.lab is None else [given.lab]
    outcomes = {k: seen(labs[k], k) for k in chosen}
    nees = np.array([outcome.nees for outcome in outcomes.values()])
    beyond = np.array([outcome.beyond for outcome in outcomes.values()])
    print(f"{len(chosen)} labs{'':12}{'NEES':>8}{'10 %':>8}{'90 %':>8}{'.5 to 2':>9}{'beyond':>9}")
    for k, name in enumerate(QUANTITIES):
        low, middle, high = np.nanquantile(nees[:, k], [0.1, 0.5, 0.9])
        well = np.mean((nees[:, k] > 0.5) & (nees[:, k] < 2.0))
        print(f"{name:20}{middle:8.2f}{low:8.2f}{high:8.2f}{well:9.3f}{np.nanmean(beyond[:, k]):9.4f}")
    print(f"tracked while the leader moves: {np.mean([each.tracked for each in outcomes.values()]):.3f}")
    by_badness = sorted(chosen, key=lambda k: -float(np.nan_to_num(outcomes[k].nees, nan=1e9).max()))
    for k in by_badness[: given.worst]:
        figures = " ".join(f"{value:.2f}" for value in outcomes[k].nees)
        print(f"lab {k}: nees {figures}, tracked {outcomes[k].tracked:.2f}, {labs[k]}")


if __name__ == "__main__":
    main()
