"""Stamps off by a microsecond and messages of one instant in another order: the estimate hardly changes.

A filter that divides a step by the time between two stamps jumps by metres a second where two of them come
close; nothing of that kind may be left, whatever the follower's motion is taken from.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from estimation.models.measurement import PairSeen
from estimation.own_motion.odometry_check import OdometrySample
from estimation.tracking.track_point import SAME_NS
from estimation.tracking.tracker import TRACKING
from formation.pose import Pose, advance
from formation.records import load, row_of
from formation.wrapping import wrapped
from hil.nodes import estimator_step as step
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import NOTHING_KNOWN
from hil.nodes.estimator_memory import rules_of
from hil.nodes.estimator_records import Known
from hil.scenario.files import load_scenario

FRAME_NS = 8_333_333
EPOCH_NS = 1_700_000_000_000_000_000
SECONDS = 3.0
MOST_V1, MOST_ANGLE = 1e-5, 5e-3
SOURCES = ("odometry", "mocap", "fused", "auto")


class Sent(NamedTuple):
    """A frame or a sample of odometry, by its stamp."""

    stamp_ns: int
    frame: PairSeen | None
    odometry: tuple[float, float, Pose] | None


def drive(seed: int) -> list[Sent]:
    """A pair in curves; every fourth frame has odometry of the same instant."""
    random = np.random.default_rng([seed, 8])
    leader, follower, base, sent = (
        Pose(0.0, 0.0, 0.0),
        Pose(0.1, -0.3, 0.1),
        Pose(0.0, 0.0, 0.0),
        list[Sent](),
    )
    for k in range(round(SECONDS / FRAME_NS * 1e9)):
        at_ns, t, dt = EPOCH_NS + k * FRAME_NS, k * FRAME_NS * 1e-9, FRAME_NS * 1e-9
        v2, u2 = 0.1 + 0.02 * math.sin(t), 0.4 * math.cos(0.9 * t)
        leader = advance(leader, 0.1, 0.5 * math.sin(1.5 * t), dt)
        follower, base = advance(follower, v2, u2, dt), advance(base, v2, u2, dt)
        n = (random.standard_normal(7) * [3e-4, 3e-4, 3e-4, 3e-4, 3.5e-3, 2e-3, 1e-2]).tolist()
        own = Pose(follower.x + n[2], follower.y + n[3], wrapped(follower.theta + n[4]))
        sent.append(Sent(at_ns, PairSeen(leader.x + n[0], leader.y + n[1], own), None))
        if k % 4 == 0:
            sent.append(Sent(at_ns, None, (v2 + n[5], u2 + n[6], base)))
    return sent


def estimates(sent: list[Sent], source: str) -> dict[int, tuple[float, float]]:
    """v1 and alpha1 of tracking estimates after every instant, by the frame's number; all else by default."""
    scenario = load_scenario("turtlebot3", {"estimator.own_motion": source})
    rules, memory = rules_of(scenario), EstimatorNode(scenario).rows_only(0).memory.desk.memory()
    knowns, found = row_of(NOTHING_KNOWN), {}
    for each in sent:
        if each.frame is not None:
            step.take_frame(knowns, memory, rules, each.stamp_ns, each.frame)
        elif each.odometry is not None:
            v2, u2, pose = each.odometry
            sample = OdometrySample(each.stamp_ns, v2, u2, True, pose)
            step.take_odometry(knowns, memory, rules, sample)
        known = load(Known, knowns, 0)
        if known.track.length == 0:
            continue
        estimate, _ = step.estimate(known, memory.points, rules, each.stamp_ns)
        if estimate.status == TRACKING:
            number = round((estimate.capture_ns - EPOCH_NS) / FRAME_NS)
            found[number] = (estimate.v1, estimate.alpha1)
    return found


def moved(sent: list[Sent], seed: int) -> list[Sent]:
    """The same with every stamp up to a microsecond earlier or later."""
    random = np.random.default_rng([seed, 11])
    return [each._replace(stamp_ns=each.stamp_ns + int(random.integers(-1000, 1001))) for each in sent]


def swapped(sent: list[Sent]) -> list[Sent]:
    """The same, of each instant the odometry before the frame."""
    return sorted(sent, key=lambda each: (each.stamp_ns, each.frame is not None))


def hardly_differ(found: dict[int, tuple[float, float]], others: dict[int, tuple[float, float]]) -> None:
    assert found.keys() == others.keys()
    assert len(found) > 200
    for number, (v1, alpha1) in found.items():
        other = others[number]
        assert abs(v1 - other[0]) < MOST_V1
        assert abs(wrapped(alpha1 - other[1])) < MOST_ANGLE


@pytest.mark.parametrize("seed", [0, 4])
@pytest.mark.parametrize("source", SOURCES)
def test_a_microsecond_off_changes_next_to_nothing(source: str, seed: int) -> None:
    sent = drive(seed)
    hardly_differ(estimates(sent, source), estimates(moved(sent, seed), source))


@pytest.mark.parametrize("source", SOURCES)
def test_nor_does_the_order_of_messages_of_one_instant(source: str) -> None:
    sent = drive(3)
    hardly_differ(estimates(sent, source), estimates(swapped(sent), source))


@pytest.mark.parametrize("later_ns", [0, 1000, SAME_NS - 1])
def test_a_frame_that_comes_twice_counts_once(later_ns: int) -> None:
    """One in ten comes again, with noise of its own: over a microsecond the difference is 100 m/s."""
    sent, random = drive(4), np.random.default_rng(4)
    doubled = list[Sent]()
    for k, each in enumerate(sent):
        doubled.append(each)
        if each.frame is not None and k % 10 == 0:
            dx, dy = (3e-4 * random.standard_normal(2)).tolist()
            again = each.frame._replace(leader_x=each.frame.leader_x + dx, leader_y=each.frame.leader_y + dy)
            doubled.append(Sent(each.stamp_ns + later_ns, again, None))
    assert estimates(sent, "auto") == estimates(doubled, "auto")
