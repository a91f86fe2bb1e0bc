"""A noise of the motion capture that is told wrongly: the leader's driving is found as by the right one."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from estimation.models.measurement import PairSeen
from formation.pose import Pose, advance
from formation.records import load, row_of
from formation.wrapping import wrapped
from hil.nodes import estimator_step as step
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import NOTHING_KNOWN
from hil.nodes.estimator_memory import rules_of
from hil.nodes.estimator_records import Known
from hil.scenario.files import load_scenario

FRAME_NS, FRAMES, STANDS = 8_333_333, 720, 30
SD_POSITION, SD_HEADING = 3e-4, 3.5e-3


@functools.cache
def known_of(told: float, how: str) -> Known:
    """What is known of a pair that sets off into curves, its noise being told so many times too large."""
    given = {
        "estimator.sigma_position": told * SD_POSITION,
        "estimator.sigma_heading": told * SD_HEADING,
        "estimator.noise": how,
        "estimator.own_motion": "mocap",
    }
    scenario = load_scenario("turtlebot3", given)
    rules, memory = rules_of(scenario), EstimatorNode(scenario).rows_only(0).memory.desk.memory()
    random, knowns = np.random.default_rng(3), row_of(NOTHING_KNOWN)
    leader, follower = Pose(0.0, 0.0, 0.0), Pose(0.0, -0.4, 0.0)
    for k in range(FRAMES):
        if k >= STANDS:
            dt, u = FRAME_NS * 1e-9, 0.5 * math.sin(1.5e-9 * FRAME_NS * k)
            leader, follower = advance(leader, 0.08, u, dt), advance(follower, 0.08, u, dt)
        n = (random.standard_normal(5) * [*[SD_POSITION] * 4, SD_HEADING]).tolist()
        own = Pose(follower.x + n[2], follower.y + n[3], wrapped(follower.theta + n[4]))
        seen = PairSeen(leader.x + n[0], leader.y + n[1], own)
        step.take_frame(knowns, memory, rules, 1_000_000_000 + k * FRAME_NS, seen)
    return load(Known, knowns, 0)


@pytest.mark.parametrize("told", [1.0 / 3.0, 3.0])
def test_the_process_noise_found_is_that_of_a_filter_told_rightly(told: float) -> None:
    wrongly, rightly = known_of(told, "estimated"), known_of(1.0, "given")
    assert wrongly.noise.scale.position == pytest.approx(1.0 / told, rel=0.1)
    assert abs(math.log(wrongly.process.speed / rightly.process.speed)) < 0.3
    assert abs(math.log(wrongly.process.turn / rightly.process.turn)) < 0.3
    assert rightly.process.speed < 0.1


def test_what_is_learned_rests_on_the_noise_as_it_was_known_when_that_began() -> None:
    found = known_of(1.0 / 3.0, "estimated")
    assert found.process.begun
    assert found.noise.basis == pytest.approx(found.noise.scale.position, rel=0.2)
