"""What one step of a filter costs from Python: the compiled filters against filterpy's, interleaved.

    python benchmarks/filter_step.py [--rounds 200]

A step is what a track does with a measurement, through the interface of all estimators: from belief, motion
and measurement to a new belief. filterpy's takes its two calls, predict and update; the compiled one is a
single call that also gates and hands out the NIS. ``kernel`` is the same step without the interface,
``belief`` what it costs to build the belief that a step hands out. Medians over
the rounds; the ratio is the median of the ratios within a round, so that a busy machine slows both sides.
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

from estimation.filters import kernels
from estimation.filters.belief import Belief, Model
from estimation.filters.estimators import make_estimator
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement

DT = 1.0 / 120.0
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.22, k_u=0.7)
WORLD = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
FOLLOWER = FollowerMotion(0.1, 0.2, 5e-3, 3e-2)
SEEN = Measurement(0, np.array([0.3, 0.1]), 1e-6 * np.eye(2), FOLLOWER)
GATE = 18.4
TARGETS = {"ekf": 20.0, "ukf": 50.0}

Step = Callable[[], object]


def settled(model: Model) -> Belief:
    """A belief as it is in mid-run."""
    estimator = make_estimator("ekf", model)
    belief = estimator.start(SEEN)
    for _ in range(60):
        belief = estimator.update(estimator.predict(belief, DT, FOLLOWER), SEEN)
    return belief


def step_of(name: str, model: Model, belief: Belief) -> Step:
    estimator = make_estimator(name, model)
    return lambda: estimator.step(belief, DT, FOLLOWER, SEEN, GATE)


def step_of_peer(name: str, model: Model, belief: Belief) -> Step:
    estimator = make_estimator(f"{name}-filterpy", model)
    return lambda: estimator.update(estimator.predict(belief, DT, FOLLOWER), SEEN)


def kernel_step(name: str, model: Model, belief: Belief) -> Step:
    kernel = kernels.extended_step if name == "ekf" else kernels.unscented_step
    own = FOLLOWER if model.front_end is FrontEnd.BODY else FollowerMotion(0.0, 0.0, 0.0, 0.0)
    given, drive = model.noise, (own.v2, own.u2, own.sd_v2, own.sd_u2)
    noise = np.array([given.q_v, given.q_u, given.v_eps, given.q_start, model.input_correlation])
    before, spread, seen, scatter = belief.mean, belief.covariance, SEEN.position, SEEN.covariance
    after, joint = np.empty(5), np.empty((5, 5))
    return lambda: kernel(before, spread, DT, *drive, noise, seen, scatter, GATE, after, joint)


def new_belief(_belief: Belief) -> Step:
    return lambda: Belief(np.empty(5), np.empty((5, 5)))


def seconds_each(step: Step, count: int) -> float:
    begin = time.perf_counter()
    for _ in range(count):
        step()
    return (time.perf_counter() - begin) / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200)
    rounds = parser.parse_args().rounds
    print("filter  front   filterpy  compiled    kernel    belief   ratio  target  ratio of kernel")
    for model in (WORLD, replace(WORLD, front_end=FrontEnd.BODY)):
        belief = settled(model)
        for name, target in TARGETS.items():
            timed = [
                (step_of_peer(name, model, belief), 10),
                (step_of(name, model, belief), 100),
                (kernel_step(name, model, belief), 100),
                (new_belief(belief), 100),
            ]
            took = np.array([[seconds_each(step, count) for step, count in timed] for _ in range(rounds)])
            times = "  ".join(f"{1e6 * each:5.1f} us" for each in np.median(took, axis=0))
            ratio, bare = (float(np.median(took[:, 0] / took[:, k])) for k in (1, 2))
            print(
                f"{name:6}  {model.front_end.value:5}  {times}  {ratio:5.1f}x  {target:5.0f}x  {bare:14.1f}x"
            )


if __name__ == "__main__":
    main()
