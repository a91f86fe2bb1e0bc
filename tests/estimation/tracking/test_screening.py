from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from estimation.tracking.screening import Cause, Watch, carried, cause_of, looked_at, watch_from

from estimation.models.measurement import PairSeen, PoseNoise
from estimation.models.motion import FollowerMotion
from formation.pose import Pose, advance

NOISE = PoseNoise(3e-4, 3.5e-3)
GATE = 18.42
DT = 1.0 / 120.0
OWN = FollowerMotion(0.1, 0.5, 5e-3, 3e-2)
STANDS = FollowerMotion(0.0, 0.0, 5e-3, 3e-2)
LEADER = (0.3, 0.1)
HERE = Pose(0.5, 0.1, 1.0)


def at(pose: Pose, leader: tuple[float, float] = LEADER) -> PairSeen:
    return PairSeen(leader, pose, NOISE)


def judged(seen: PairSeen, watch: Watch | None = None, *, leader_moves: bool = False) -> Cause | None:
    """Cause against a frame that comes one period after the follower was seen at HERE."""
    expected = watch or carried(watch_from(at(HERE, (9.0, 9.0))), OWN, OWN, DT)
    return cause_of(*looked_at(expected, seen, GATE, leader_moves=leader_moves), GATE)


THERE = advance(HERE, 0.1, 0.5, DT)


def test_a_follower_where_its_motion_took_it_passes() -> None:
    assert judged(at(THERE)) is None


@pytest.mark.parametrize("angle", [0.0, 1.5, 3.0, -2.0])
def test_one_that_stepped_does_not(angle: float) -> None:
    stepped = replace(THERE, x=THERE.x + 0.02 * math.cos(angle), y=THERE.y + 0.02 * math.sin(angle))
    assert judged(at(stepped)) is Cause.FOLLOWER


def test_headings_that_jump_are_told_from_such_that_turn_round() -> None:
    assert judged(at(replace(THERE, theta=THERE.theta + 0.5))) is Cause.FOLLOWER
    assert judged(at(replace(THERE, theta=THERE.theta - math.pi))) is Cause.FLIPPED


def test_bodies_that_change_places_are_recognised() -> None:
    swapped = PairSeen((THERE.x, THERE.y), Pose(*LEADER, -1.0), NOISE)
    assert judged(swapped) is Cause.SWAPPED


def test_a_moving_leader_that_repeats_its_position_has_frozen_and_a_standing_one_has_not() -> None:
    watch = carried(watch_from(at(HERE)), OWN, OWN, DT)
    assert judged(at(THERE), watch, leader_moves=True) is Cause.FROZEN
    assert judged(at(THERE), watch) is None
    assert judged(at(THERE, (0.3, 0.1 + 1e-12)), watch, leader_moves=True) is None


def test_a_follower_that_drives_and_repeats_its_pose_has_frozen_until_another_pose_comes() -> None:
    watch, causes = watch_from(at(HERE, (9.0, 9.0))), []
    for k in range(240):
        moving = OWN if k < 60 else STANDS
        watch = carried(watch, moving, moving, DT)
        watch, off = looked_at(watch, at(HERE, (9.0, float(k))), GATE, leader_moves=True)
        causes.append(cause_of(watch, off, GATE))
    # Within the noise nobody can tell; then it stays so, though a robot without sight stops.
    first = causes.index(Cause.FROZEN)
    assert first * DT < 0.1
    assert set(causes[first:]) == {Cause.FROZEN}
    fresh, off = looked_at(watch, at(watch.pose, (9.0, -1.0)), GATE, leader_moves=True)
    assert cause_of(fresh, off, GATE) is None


def test_a_follower_that_stands_may_repeat_its_pose_for_ever() -> None:
    watch = watch_from(at(HERE, (9.0, 9.0)))
    for k in range(2000):
        watch = carried(watch, STANDS, STANDS, DT)
        watch, off = looked_at(watch, at(HERE, (9.0, float(k))), GATE, leader_moves=True)
        assert cause_of(watch, off, GATE) is None


def test_what_may_pass_grows_while_nothing_is_seen_and_shrinks_with_the_next_pose() -> None:
    watch = watch_from(at(HERE))
    for _ in range(120):
        watch = carried(watch, STANDS, STANDS, DT)
    aside = replace(HERE, x=HERE.x + 0.015)
    assert judged(at(aside)) is not None
    assert judged(at(aside), watch) is None
    after, _ = looked_at(watch, at(aside, (9.0, 9.0)), GATE, leader_moves=False)
    assert (after.pose, after.sd_position, after.sd_heading) == (aside, 0.0, 0.0)


def test_of_good_poses_no_more_are_rejected_than_the_gate_says() -> None:
    generator = np.random.default_rng(3)
    pose, watch, rejected, count = HERE, watch_from(at(HERE)), 0, 6_000
    gate = -2.0 * math.log(0.01)
    for k in range(count):
        pose = advance(pose, OWN.v2, OWN.u2, DT)
        x, y, turned = (generator.standard_normal(3) * [3e-4, 3e-4, 3.5e-3]).tolist()
        v, u = (generator.standard_normal(2) * [2e-3, 1e-2]).tolist()
        measured = FollowerMotion(OWN.v2 + v, OWN.u2 + u, 5e-3, 3e-2)
        seen = at(Pose(pose.x + x, pose.y + y, pose.theta + turned), (0.0, float(k)))
        watch, off = looked_at(carried(watch, measured, measured, DT), seen, gate, leader_moves=True)
        rejected += cause_of(watch, off, gate) is not None
    assert 0.0 < rejected / count < 0.014
