"""What one step of a filter costs, compiled and from Python, against filterpy's, interleaved.

    python benchmarks/filter_step.py [--rounds 200]

A step is what a track does with a measurement: from belief, motion and measurement to a new belief, with
gate and NIS. ``loop``: in a compiled loop, as the whole estimator runs. ``entry``: one call from Python that
changes rows in place. filterpy's takes its two calls, predict and update, and has neither gate nor NIS.
Processor time, so that a busy machine counts little; medians over the rounds, a ratio being the median of
the ratios within a round.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.filters.belief import Belief, Model
from estimation.filters.entries import step
from estimation.filters.estimator import Estimator
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.filters.kalman import ExtendedFilter, UnscentedFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from formation.kernel import entry
from formation.records import Rows, load, row_of, store

DT = 1.0 / 120.0
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.22, k_u=0.7)
WORLD = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
FOLLOWER = FollowerMotion(0.1, 0.2, 5e-3, 3e-2)
SEEN = Measurement.at(0, np.array([0.3, 0.1]), 1e-6 * np.eye(2), FOLLOWER)
GATE = 18.4
LOOPS, CALLS, PEERS = 2000, 200, 10
"""Steps of each kind in a round."""
WANTED = {Kind.EKF: (500.0, 60.0), Kind.UKF: (250.0, 100.0)}
"""Ratios that are wanted, in a loop and by calls."""


@entry
def steps(
    beliefs: Rows[Gaussian],
    measurements: Rows[Measurement],
    filters: Rows[Filter],
    dt: float,
    gate: float,
    count: int,
) -> float:
    """So many steps of a belief with ever the same measurement."""
    belief, estimator = load(Gaussian, beliefs, 0), load(Filter, filters, 0)
    measurement, nis = load(Measurement, measurements, 0), 0.0
    for _ in range(count):
        stepped = estimator.step(belief, dt, measurement.motion, measurement, gate)
        belief, nis = stepped.belief, stepped.nis
    store(beliefs, 0, belief)
    return nis


def settled(peer: Estimator) -> Belief:
    """A belief as it is in mid-run."""
    belief = peer.start(SEEN)
    for _ in range(60):
        belief = peer.update(peer.predict(belief, DT, FOLLOWER), SEEN)
    return belief


def seconds(work: Callable[[], object], count: int = 1) -> float:
    begin = time.thread_time_ns()
    for _ in range(count):
        work()
    return 1e-9 * (time.thread_time_ns() - begin)


def timed(kind: Kind, model: Model, rounds: int) -> np.ndarray:
    """Seconds (rounds, 3) of a step of filterpy's, in the loop and by a call."""
    peer = ExtendedFilter(model) if kind is Kind.EKF else UnscentedFilter(model)
    belief = settled(peer)
    beliefs, seen, filters = row_of(belief.gaussian), row_of(SEEN), row_of(filter_of(kind, model))
    took = [
        (
            seconds(lambda: peer.update(peer.predict(belief, DT, FOLLOWER), SEEN), PEERS) / PEERS,
            seconds(lambda: steps(beliefs, seen, filters, DT, GATE, LOOPS)) / LOOPS,
            seconds(lambda: step(beliefs, seen, filters, DT, GATE), CALLS) / CALLS,
        )
        for _ in range(rounds)
    ]
    return np.array(took)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200)
    rounds = parser.parse_args().rounds
    print("filter  front    filterpy       loop      entry  ratio of loop  wanted  ratio of entry  wanted")
    for model in (WORLD, replace(WORLD, front_end=FrontEnd.BODY)):
        for kind, (in_loop, by_call) in WANTED.items():
            took = timed(kind, model, rounds)
            peer, loop, call = 1e6 * np.median(took, axis=0)
            ratios = [float(np.median(took[:, 0] / took[:, k])) for k in (1, 2)]
            times = f"{peer:6.1f} us  {1e3 * loop:6.1f} ns  {1e3 * call:6.1f} ns"
            ratio_columns = f"{ratios[0]:12.0f}x  {in_loop:5.0f}x  {ratios[1]:13.0f}x  {by_call:5.0f}x"
            print(f"{kind.name.lower():6}  {model.front_end.value:5}  {times}  {ratio_columns}")


if __name__ == "__main__":
    main()
