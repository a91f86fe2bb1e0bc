"""What the order of delivery does to the estimates: it should do nothing.

    python benchmarks/delivery.py [--seeds 3] [--seconds 5]

Frames at 120 Hz and odometry at 30 Hz go through the estimator node twice: as they were made, and with every
message somewhere else within its 100 ms and one in ten sent twice. After each such horizon both runs have got
the same, so that their estimates must agree. Noise is given, as it is learned from frames in order only. The
first horizon comes in order, as a track begins with the first frame that it gets. Printed, for each source of
own motion and both front ends: the largest difference of any quantity and of the covariance, over the
standard deviations, and how many frames came late.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from estimation.tracking.estimate import Estimate
from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.estimator import EstimatorNode
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import encode

SOURCES = ("odometry", "mocap", "fused")
FRONT_ENDS = ("world", "body")
HORIZON_NS = 100_000_000
FRAME_NS, ODOMETRY_NS = 8_333_333, 33_333_333
DUPLICATED = 0.1
LEARNING_NOTHING = ("estimator.noise=given", "estimator.process_noise=given")

Sent = list[tuple[int, Event]]
"""Messages with the time that they tell of."""


@dataclass(frozen=True)
class Difference:
    """Largest differences of quantities and covariance, horizons compared, frames that came late."""

    quantities: float
    covariance: float
    horizons: int
    late: int


def messages(seed: int, seconds: float) -> Sent:
    """Frames and odometry of a pair that drives in curves, by time."""
    generator, sent = np.random.default_rng([seed, 1]), Sent()
    leader, follower = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6)
    at_ns, next_odometry_ns = 0, 0
    for k in range(round(seconds * 1e9 / FRAME_NS)):
        wave = float(np.sin(1.3 * k * FRAME_NS * 1e-9))
        led, own = Motion(0.08, 0.2 + 0.5 * wave), Motion(0.1 + 0.03 * wave, 0.4 - 0.5 * wave)
        shake = (generator.standard_normal(7) * [3e-4, 3e-4, 3e-4, 3e-4, 3e-3, 2e-3, 1e-2]).tolist()
        pair = [
            ("leader", Pose(leader.x + shake[0], leader.y + shake[1], leader.theta)),
            ("follower", Pose(follower.x + shake[2], follower.y + shake[3], follower.theta + shake[4])),
        ]
        frame = frame_message(EPOCH_NS + at_ns, k, pair)
        sent.append((at_ns, Event(topics.RIGID_BODIES, encode(frame))))
        if at_ns >= next_odometry_ns:
            measured = Motion(own.v + shake[5], own.u + shake[6])
            odometry = odometry_message(EPOCH_NS + at_ns, "follower", follower, measured)
            sent.append((at_ns, Event("follower/odom", encode(odometry))))
            next_odometry_ns += ODOMETRY_NS
        leader = advance(leader, led.v, led.u, FRAME_NS * 1e-9)
        follower = advance(follower, own.v, own.u, FRAME_NS * 1e-9)
        at_ns += FRAME_NS
    return sent


def horizons(sent: Sent, seed: int | None) -> list[list[Event]]:
    """Messages of every horizon: in order, or shuffled by a seed with some of them sent twice."""
    made: list[list[Event]] = [[] for _ in range(sent[-1][0] // HORIZON_NS + 1)]
    for at_ns, event in sent:
        made[at_ns // HORIZON_NS].append(event)
    if seed is None:
        return made
    generator = np.random.default_rng([seed, 2])
    shaken = made[:1]
    for events in made[1:]:
        twice = [event for event in events if generator.random() < DUPLICATED]
        both = [*events, *twice]
        shaken.append([both[k] for k in generator.permutation(len(both))])
    return shaken


def delivered(node: EstimatorNode, parts: list[list[Event]]) -> tuple[list[Estimate], int]:
    """Estimate after each horizon, and how many frames came late."""
    state, found = node.begin(EPOCH_NS), []
    for number, events in enumerate(parts, start=1):
        now_ns = EPOCH_NS + number * HORIZON_NS
        for event in events:
            state, _ = node.step(state, event, now_ns)
        newest = state.memory.estimate(now_ns)
        assert newest is not None
        found.append(newest.estimate)
    return found, state.taken.get("late", 0)


def compare(source: str, front_end: str, seed: int, seconds: float) -> Difference:
    """Shuffled against in-order delivery."""
    given = [f"estimator.own_motion={source}", f"estimator.front_end={front_end}", *LEARNING_NOTHING]
    node, sent = EstimatorNode(load_scenario("turtlebot3", given)), messages(seed, seconds)
    in_order, _ = delivered(node, horizons(sent, None))
    shaken, late = delivered(node, horizons(sent, seed))
    quantities, covariance = 0.0, 0.0
    for one, other in zip(in_order, shaken, strict=True):
        assert (one.capture_ns, one.status) == (other.capture_ns, other.status)
        sd = np.sqrt(np.diag(one.covariance))
        names = ("rho_dot", "alpha2_dot", "v1", "alpha1", "u1")
        off = [abs(getattr(one, name) - getattr(other, name)) / sd[k] for k, name in enumerate(names)]
        off += [abs(one.rho - other.rho), abs(one.alpha2 - other.alpha2)]
        off += [abs(one.v2 - other.v2), abs(one.u2 - other.u2)]
        quantities = max(quantities, *off)
        apart = np.abs(one.covariance - other.covariance) / np.outer(sd, sd)
        covariance = max(covariance, float(np.max(apart)))
    return Difference(quantities, covariance, len(in_order), late)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=5.0)
    given = parser.parse_args()
    print(f"{'front end':10} {'own motion':10} quantities covariance  horizons  late")
    for front_end in FRONT_ENDS:
        for source in SOURCES:
            found = [compare(source, front_end, seed, given.seconds) for seed in range(given.seeds)]
            quantities = max(each.quantities for each in found)
            covariance = max(each.covariance for each in found)
            late, compared = sum(each.late for each in found), sum(each.horizons for each in found)
            row = f"{front_end:10} {source:10} {quantities:10.1e} {covariance:10.1e}"
            print(f"{row} {compared:9} {late:5}", flush=True)


if __name__ == "__main__":
    main()
