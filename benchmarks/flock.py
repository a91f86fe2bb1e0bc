"""A flock that follows its nearest neighbours: agent-seconds per second, and what they are worth.

    python benchmarks/flock.py [--duration 20] [--rounds 5] [--quick]

Arrowheads of several sizes, scattered, then gathering behind a leader that swerves; three neighbours, chosen
anew every 0.5 s; gains of the shipped scenario, no speed limit. Times are processor time of the one thread,
medians over rounds; sampling every 0.1 s with the clearances of all agents is included. The error is the
largest of all positions and samples against a step of 1.25 ms. The peer is the same method with the laws and
the virtual leader in Python, over 0.4 s.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.virtual_leader import virtual_leader
from controllers.flock import Choice, FlockTrajectory, simulate_flock
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from formation.flock_places import LEAST_BEARING, may_follow, skein
from formation.leader import Impulse
from formation.pose import Motion, Pose
from formation.shape import shape_of
from formation.spacing import Spacing
from formation.station import Side, Station

FloatArray = NDArray[np.float64]

SPACING, MU_RHO, MU1, MU2, NEIGHBOURS = 0.5, 2.0, 1.0, 2.0, 3
PROGRAM = Impulse(0.5, 0.02, 10.0, 3.0)
LIMITS, CHOICE = Limits(1e3, 1e3), Choice(NEIGHBOURS, 0.5, LEAST_BEARING)
SAMPLE_S, FINEST = 0.1, 0.00125
SIZES, STEPS = (10, 109, 500, 1000), (0.01, 0.02)


def start(agents: int) -> FloatArray:
    off = np.random.default_rng(1).uniform(-1.0, 1.0, (agents, 3)) * (0.1, 0.1, 0.3)
    off[0] = 0.0
    return np.column_stack([skein(agents, SPACING), np.zeros(agents)]) + off


def compiled(agents: int, duration: float, step: float) -> FlockTrajectory:
    return simulate_flock(
        start(agents),
        skein(agents, SPACING),
        PROGRAM,
        Gains(MU1, MU2, Spacing(SPACING, MU_RHO)),
        LIMITS,
        CHOICE,
        duration,
        knows_turn=False,
        step=step,
        steps_per_sample=round(SAMPLE_S / step),
    )


def plain(agents: int, steps: int, step: float) -> FloatArray:
    """Poses (N, 3) after so many steps, the neighbours chosen once."""
    places, state = skein(agents, SPACING), start(agents)
    allowed, followed, gains = may_follow(places), [[0]], [Gains(MU1, MU2, Spacing(SPACING, MU_RHO))]
    for agent in range(1, agents):
        whom = np.flatnonzero(allowed[agent])
        nearest = np.argsort(np.linalg.norm(state[whom, :2] - state[agent, :2], axis=1))[:NEIGHBOURS]
        followed.append(whom[nearest].tolist())
        ahead, left = (places[followed[-1]].mean(axis=0) - places[agent]).tolist()
        station = Station(Side.RIGHT if left > 0.0 else Side.LEFT, math.atan2(abs(left), ahead))
        gains.append(Gains(MU1, MU2, Spacing(math.hypot(ahead, left), MU_RHO), station))

    def rates(t: float, poses: FloatArray) -> FloatArray:
        agents_at = [Pose(*row) for row in poses.tolist()]
        motions: list[Motion] = [PROGRAM(t)]
        for agent in range(1, agents):
            whom = followed[agent]
            pose, motion = virtual_leader([agents_at[k] for k in whom], [motions[k] for k in whom])
            shape = shape_of(pose, agents_at[agent])
            motions.append(LAWS["independent"](shape, motion.v, motion.u, gains[agent], LIMITS))
        agents_motions = zip(agents_at, motions, strict=True)
        return np.array([(m.v * math.cos(a.theta), m.v * math.sin(a.theta), m.u) for a, m in agents_motions])

    for k in range(steps):
        t = k * step
        one = rates(t, state)
        two = rates(t + 0.5 * step, state + 0.5 * step * one)
        three = rates(t + 0.5 * step, state + 0.5 * step * two)
        four = rates(t + step, state + step * three)
        state = state + step / 6.0 * (one + 2.0 * (two + three) + four)
    return state


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="the two smaller flocks only")
    given = parser.parse_args()
    print(f"{given.duration:g} s, {NEIGHBOURS} neighbours, {given.rounds} rounds")
    print(f"{'agents':>6}{'step [s]':>10}{'agent-s per s':>15}{'times real time':>17}{'error [m]':>11}")
    for agents in SIZES[:2] if given.quick else SIZES:
        known = compiled(agents, given.duration, FINEST).poses[:, :, :2]
        for step in STEPS:
            took = []
            for _ in range(given.rounds):
                begin = time.thread_time()
                found = compiled(agents, given.duration, step)
                took.append(time.thread_time() - begin)
            rate = given.duration / statistics.median(took)
            error = float(np.abs(found.poses[:, :, :2] - known).max())
            print(f"{agents:6}{step:10g}{agents * rate:15.0f}{rate:17.1f}{error:11.1e}")
    agents, step, steps = SIZES[1], STEPS[0], 40
    begin = time.thread_time()
    ended = plain(agents, steps, step)
    rate = steps * step / (time.thread_time() - begin)
    known = compiled(agents, steps * step, step).poses[-1]
    error = float(np.abs(ended[:, :2] - known[:, :2]).max())
    print(
        f"{agents:6}{step:10g}{agents * rate:15.0f}{rate:17.2f}{error:11.1e}  in Python, error against ours"
    )


if __name__ == "__main__":
    main()
