"""What the proposed gains are worth, beside gains picked by hand and beside lower and higher ones.

    python benchmarks/gains.py [--seeds 3] [--shares]

For several robots, all else as in ``turtlebot3``: RMS distance of rho from rho_0 [mm], by the compiled closed
loop, with the gains of ``abreast gains``, with hand-picked ones (those of ``turtlebot3``, scaled by size and
speed in ``slow`` and ``fast``), and with the proposed ones times s (mu_rho times s^2).

With ``--shares`` instead: the same with gains proposed for other shares of the delay that the prediction
leaves, ``controllers.gain_task.UNPREDICTED``, over latencies; a dash where none are.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.feedforward import distance_mm
from controllers.gain_design import design
from hil.scenario.files import load_scenario
from hil.simulate.gain_proposal import propose, task_of

Gains = tuple[float, float, float]
"""mu1, mu2, mu_rho."""

FACTORS = (0.5, 0.7, 1.4, 2.0, 4.0)
SHARES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
LATENCIES_S = (0.3, 0.5, 0.8, 1.0)
PATIENT = ("controller.max_age_s=1.5", "estimator.coast_after_s=1.5", "estimator.lost_after_s=2.5")


def _robot(v_max: float, u_max: float, lag: float) -> tuple[str, ...]:
    return tuple(
        f"{who}.{key}={value}"
        for who in ("robot", "controller")
        for key, value in (("v_max", v_max), ("u_max", u_max), ("lag_s", lag))
    )


def _swinging(v: float, u_mean: float, u_amplitude: float, omega: float) -> str:
    numbers = f"v = {v}, u_mean = {u_mean}, u_amplitude = {u_amplitude}, omega = {omega}"
    return f'leader.program={{ kind = "sinusoid", {numbers} }}'


ROBOTS: Mapping[str, tuple[Sequence[str], Gains]] = {
    "turtlebot3": ((), (1.5, 2.0, 20.0)),
    "slow": (
        (
            *("formation.rho_0=0.3", "leader.v_eps=0.03", "leader.k_v=0.05", "leader.k_u=0.15"),
            *(_swinging(0.04, 0.05, 0.1, 0.5), *_robot(0.1, 1.0, 0.3)),
            *("run.duration_s=60", "run.evaluate_from_s=30"),
        ),
        (0.5, 0.67, 13.3),
    ),
    "fast, latency 0.3 s": (
        (
            *("formation.rho_0=0.8", "leader.v_eps=0.3", "leader.k_v=0.6", "leader.k_u=0.4"),
            *(_swinging(0.5, 0.1, 0.3, 0.6), *_robot(1.0, 3.0, 0.15)),
            *("mocap.latency_s=0.3", *PATIENT),
        ),
        (2.34, 3.1, 5.0),
    ),
    "turtlebot3, latency 0.8 s": (("mocap.latency_s=0.8", *PATIENT), (1.5, 2.0, 20.0)),
    "turtlebot3, noise 5 mm": (
        ("mocap.sigma_position=0.005", "estimator.sigma_position=0.005"),
        (1.5, 2.0, 20.0),
    ),
}


def _leaders() -> Mapping[str, Sequence[str]]:
    """Robots and leaders to be held against delays."""
    fast = (
        *("formation.rho_0=0.8", "leader.v_eps=0.3", "leader.k_v=0.6", "leader.k_u=0.4"),
        *_robot(1.0, 3.0, 0.15),
    )
    return {
        "swings of 4 s": (),
        "4 s, noise 5 mm": ("mocap.sigma_position=0.005", "estimator.sigma_position=0.005"),
        "4 s, v_max 0.6 m/s": _robot(0.6, 6.0, 0.1),
        "swings of 2 s": (_swinging(0.08, 0.0, 0.7, math.pi),),
        "swings of 16 s": ("leader.k_u=0.4", _swinging(0.08, 0.1, 0.3, 0.4)),
        "fast, 10 s": (*fast, _swinging(0.5, 0.1, 0.3, 0.6)),
        "fast, 3 s": (*fast, _swinging(0.5, 0.1, 0.3, 2.0)),
    }


def over_shares(given: Sequence[str], seeds: int) -> Iterator[float]:
    """RMS distance from rho_0 [mm] with the gains proposed for each of the shares; nan without gains."""
    task = task_of(load_scenario("turtlebot3", given))
    for share in SHARES:
        gains = design(replace(task, unpredicted=share)).gains
        yield math.nan if gains is None else distance_mm([*given, *_with_gains(gains)], seeds)


def _with_gains(gains: Gains) -> list[str]:
    names = ("mu1", "mu2", "mu_rho")
    return [f"controller.{name}={value}" for name, value in zip(names, gains, strict=True)]


def proposed(robot: str) -> Gains:
    """Gains that are proposed for a robot; raises :class:`ValueError` if there are none."""
    found = propose(load_scenario("turtlebot3", ROBOTS[robot][0]))
    if found.gains is None:
        raise ValueError(f"no gains for {robot}: {found.why}")
    gains = found.gains
    return gains["mu1"], gains["mu2"], gains["mu_rho"]


def kept_mm(robot: str, gains: Gains, seeds: int) -> float:
    """RMS distance from rho_0 [mm] of a robot with gains."""
    return distance_mm([*ROBOTS[robot][0], *_with_gains(gains)], seeds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--shares", action="store_true")
    chosen = parser.parse_args()
    if chosen.shares:
        _tell_shares(chosen.seeds)
    else:
        _tell_robots(chosen.seeds)


def _tell_shares(seeds: int) -> None:
    print(f"{'':20} latency {''.join(f'{share:8g}' for share in SHARES)}")
    for name, given in _leaders().items():
        for latency in LATENCIES_S:
            found = over_shares([*given, f"mocap.latency_s={latency}", *PATIENT], seeds)
            cells = ("       -" if math.isnan(each) else f"{each:8.1f}" for each in found)
            print(f"{name:20} {latency:5g} s {''.join(cells)}", flush=True)


def _tell_robots(seeds: int) -> None:
    print(f"{'':26} {'mu1, mu2, mu_rho':>22} proposed by hand {''.join(f'  s={s:<4g}' for s in FACTORS)}")
    for robot, (_, by_hand) in ROBOTS.items():
        mu1, mu2, mu_rho = gains = proposed(robot)
        cells = [kept_mm(robot, gains, seeds), kept_mm(robot, by_hand, seeds)]
        scaled = [kept_mm(robot, (s * mu1, s * mu2, s * s * mu_rho), seeds) for s in FACTORS]
        shown = f"{mu1:.3g}, {mu2:.3g}, {mu_rho:.3g}"
        means = f"{cells[0]:8.1f} {cells[1]:7.1f} {''.join(f'{each:8.1f}' for each in scaled)}"
        print(f"{robot:26} {shown:>22} {means}", flush=True)


if __name__ == "__main__":
    main()
