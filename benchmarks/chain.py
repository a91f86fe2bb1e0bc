"""A chain of agents under Prop. 1 with a speed limit: the compiled solver against scipy's, side by side.

    python benchmarks/chain.py [--agents 100] [--duration 30] [--rounds 5]

Peers are ``scipy.integrate.solve_ivp`` with RK45, rtol 1e-5 and atol 1e-6 (the settings of the paper) on the
paper's own variables, once with the laws in plain Python and once with the rates from the compiled kernel.
Errors are the largest over all samples, agents and a grid of 0.1 s, against DOP853 at 1e-12: of the distance
relative to it, of the bearings in rad. Times are processor time of the
one thread, medians over rounds in which all take their turn.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from controllers import chain_kernels
from controllers.chain import simulate_chain
from controllers.laws import Gains
from controllers.limits import Limits
from formation.leader import Impulse, encoded
from formation.pose import Pose
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape
from formation.spacing import Spacing

FloatArray = NDArray[np.float64]

RHO_0, MU_RHO, MU1, MU2, V_MAX = 0.5, 2.0, 1.0, 2.0, 1.0
PROGRAM = Impulse(0.5, 1.0, 5.0, 1.0)
GAINS, LIMITS = Gains(MU1, MU2, Spacing(RHO_0, MU_RHO)), Limits(V_MAX, 1e3)
FIRST = Pose(0.0, -0.5, 0.0)
TARGET, MEASURED = 20.0, "compiled chain, 1e-5"


Method = Literal["RK45", "DOP853", "LSODA"]
"""Of SciPy."""


def plain_rates(t: float, state: FloatArray) -> list[float]:
    """(rho, alpha1, alpha2) of each pair, then x, y, theta of the first agent, in plain Python."""
    values = state.tolist()
    driven = PROGRAM(t)
    v1, u1, heading = driven.v, driven.u, values[-1]
    tail = [v1 * math.cos(heading), v1 * math.sin(heading), u1]
    change = []
    for k in range(0, len(values) - 3, 3):
        rho, alpha1, alpha2 = values[k : k + 3]
        sin1, cos1, sin2, cos2 = math.sin(alpha1), math.cos(alpha1), math.sin(alpha2), math.cos(alpha2)
        f = MU_RHO * (rho * rho - RHO_0 * RHO_0) / (rho * rho)
        v2 = min(max(-v1 * sin1 + rho * (u1 - MU1 * cos1 + v1 * f), -V_MAX), V_MAX)
        line_rate = (v1 * sin1 + v2 * sin2) / rho
        u2 = line_rate - MU2 * cos2
        change += [-v1 * cos1 - v2 * cos2, line_rate - u1, line_rate - u2]
        v1, u1 = v2, u2
    return change + tail


def kernel_rates(agents: int) -> Callable[[float, FloatArray], FloatArray]:
    """The same from the compiled kernel."""
    program, table = encoded(PROGRAM)
    chain = chain_kernels.Chain(GAINS.settings(LIMITS), program, True)
    change, motions = np.empty(3 * agents), np.empty((3, agents))

    def rates(t: float, state: FloatArray) -> FloatArray:
        chain_kernels.rates_at(t, state, chain, table, change, motions)
        return change.copy()

    return rates


def start(agents: int) -> FloatArray:
    pair = [RHO_0, ABREAST_ALPHA1, ABREAST_ALPHA2]
    return np.array([*pair * (agents - 1), FIRST.x, FIRST.y, FIRST.theta])


def by_scipy(
    rates: Callable[[float, FloatArray], FloatArray | list[float]],
    times: FloatArray,
    agents: int,
    method: Method,
    rtol: float,
    atol: float,
) -> FloatArray:
    """(n, pairs, 3) of (rho, alpha1, alpha2)."""
    found = solve_ivp(
        rates,
        (times[0], times[-1]),
        start(agents),
        method=method,
        t_eval=times,
        rtol=rtol,
        atol=atol,
        max_step=PROGRAM.longest_step,
    )
    assert found.success, found.message
    return np.asarray(found.y.T[:, :-3].reshape(len(times), -1, 3))


def by_kernel(times: FloatArray, agents: int, relative: float) -> FloatArray:
    shapes = [Shape(RHO_0, ABREAST_ALPHA1, ABREAST_ALPHA2)] * (agents - 1)
    run = simulate_chain(
        FIRST,
        shapes,
        PROGRAM,
        GAINS,
        LIMITS,
        times,
        knows_turn=True,
        relative=relative,
        absolute=0.1 * relative,
    )
    return np.stack([run.rho, run.alpha1, run.alpha2], axis=2)


def errors(states: FloatArray, known: FloatArray) -> tuple[float, float]:
    rho = float(np.abs(states[:, :, 0] / known[:, :, 0] - 1.0).max())
    turned = states[:, :, 1:] - known[:, :, 1:]
    return rho, float(np.abs(np.arctan2(np.sin(turned), np.cos(turned))).max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--agents", type=int, default=100)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    agents, times = given.agents, np.linspace(0.0, given.duration, round(given.duration / 0.1) + 1)
    compiled = kernel_rates(agents)
    known = by_scipy(compiled, times, agents, "DOP853", 1e-12, 1e-13)
    peer = "scipy RK45 1e-5/1e-6, laws in Python"
    ways: dict[str, Callable[[], FloatArray]] = {
        peer: lambda: by_scipy(plain_rates, times, agents, "RK45", 1e-5, 1e-6),
        "scipy RK45 1e-5/1e-6, compiled rates": lambda: by_scipy(compiled, times, agents, "RK45", 1e-5, 1e-6),
        MEASURED: lambda: by_kernel(times, agents, 1e-5),
        "compiled chain, 1e-9 (default)": lambda: by_kernel(times, agents, 1e-9),
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    reached = {name: errors(way(), known) for name, way in ways.items()}
    for _ in range(given.rounds):
        for name, way in ways.items():
            begin = time.thread_time()
            way()
            seconds[name].append(time.thread_time() - begin)
    print(f"{agents} agents, {given.duration:g} s, {given.rounds} rounds")
    print(f"{'':40}{'time [ms]':>10}{'rho error':>11}{'angle error':>13}{'times faster':>14}")
    for name, took in seconds.items():
        ratio = statistics.median(a / b for a, b in zip(seconds[peer], took, strict=True))
        rho, angle = reached[name]
        print(f"{name:40}{1e3 * statistics.median(took):10.1f}{rho:11.1e}{angle:13.1e}{ratio:14.1f}")
        if name == MEASURED:
            good = ratio >= TARGET and rho <= reached[peer][0] and angle <= reached[peer][1]
            print(f"{'':4}{TARGET:g} times at equal or smaller error: {'met' if good else 'MISSED'}")


if __name__ == "__main__":
    main()
