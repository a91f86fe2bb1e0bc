from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PairSeen, PoseNoise, measure_world
from estimation.tracking.follower_check import (
    BELIEVED,
    Cause,
    FollowerCheck,
    carried,
    check_from,
    checked,
    heading_misfit,
    misfit,
    position_misfit,
)
from formation.pose import Pose, advance

NOISE = PoseNoise(3e-4, 3.5e-3)
GATE = 18.42
DT = 1.0 / 120.0
OWN = FollowerMotion(0.1, 0.5, 5e-3, 3e-2)
STANDS = FollowerMotion(0.0, 0.0, 5e-3, 3e-2)
LEADER = (0.3, 0.1)
HERE = Pose(0.5, 0.1, 1.0)


def at(pose: Pose, leader: tuple[float, float] = LEADER) -> PairSeen:
    return PairSeen(*leader, pose)


def check_at(pose: Pose, leader: tuple[float, float] = LEADER) -> FollowerCheck:
    """Check of one who has seen nothing but this frame."""
    return check_from(measure_world(0, leader, pose, NOISE, STANDS))


def judged(seen: PairSeen, check: FollowerCheck | None = None, *, leader_moves: bool = False) -> int:
    """Cause against a frame that comes one period after the follower was seen at HERE."""
    expected = check or carried(check_at(HERE, (9.0, 9.0)), OWN, OWN, DT)
    return checked(expected, seen, NOISE, GATE, leader_moves).cause


THERE = advance(HERE, 0.1, 0.5, DT)


def test_a_follower_where_its_motion_took_it_passes() -> None:
    assert judged(at(THERE)) == BELIEVED


@pytest.mark.parametrize("angle", [0.0, 1.5, 3.0, -2.0])
def test_one_that_stepped_does_not(angle: float) -> None:
    stepped = THERE._replace(x=THERE.x + 0.02 * math.cos(angle), y=THERE.y + 0.02 * math.sin(angle))
    assert judged(at(stepped)) == Cause.FOLLOWER


def test_headings_that_jump_are_told_from_such_that_turn_round() -> None:
    assert judged(at(THERE._replace(theta=THERE.theta + 0.5))) == Cause.FOLLOWER
    assert judged(at(THERE._replace(theta=THERE.theta - math.pi))) == Cause.FLIPPED


def test_bodies_that_change_places_are_recognised() -> None:
    swapped = PairSeen(THERE.x, THERE.y, Pose(*LEADER, -1.0))
    assert judged(swapped) == Cause.SWAPPED


def test_a_moving_leader_that_repeats_its_position_has_frozen_and_a_standing_one_has_not() -> None:
    check = carried(check_at(HERE), OWN, OWN, DT)
    assert judged(at(THERE), check, leader_moves=True) == Cause.FROZEN
    assert judged(at(THERE), check) == BELIEVED
    assert judged(at(THERE, (0.3, 0.1 + 1e-12)), check, leader_moves=True) == BELIEVED


def test_a_follower_that_drives_and_repeats_its_pose_has_frozen_until_another_pose_comes() -> None:
    check, causes = check_at(HERE, (9.0, 9.0)), []
    for k in range(240):
        moving = OWN if k < 60 else STANDS
        check = carried(check, moving, moving, DT)
        check, cause = checked(check, at(HERE, (9.0, float(k))), NOISE, GATE, True)
        causes.append(cause)
    # Within the noise nobody can tell; then it stays so, though a robot without sight stops.
    first = causes.index(Cause.FROZEN)
    assert first * DT < 0.1
    assert set(causes[first:]) == {Cause.FROZEN}
    assert checked(check, at(check.pose, (9.0, -1.0)), NOISE, GATE, True).cause == BELIEVED


def test_a_follower_that_stands_may_repeat_its_pose_for_ever() -> None:
    check = check_at(HERE, (9.0, 9.0))
    for k in range(2000):
        check = carried(check, STANDS, STANDS, DT)
        check, cause = checked(check, at(HERE, (9.0, float(k))), NOISE, GATE, True)
        assert cause == BELIEVED


def test_what_may_pass_grows_while_nothing_is_seen_and_shrinks_with_the_next_pose() -> None:
    check = check_at(HERE)
    for _ in range(120):
        check = carried(check, STANDS, STANDS, DT)
    aside = HERE._replace(x=HERE.x + 0.015)
    assert judged(at(aside)) != BELIEVED
    assert judged(at(aside), check) == BELIEVED
    after = checked(check, at(aside, (9.0, 9.0)), NOISE, GATE, False).check
    assert (after.pose, after.sd_position, after.sd_heading) == (aside, 0.0, 0.0)


def test_of_good_poses_no_more_are_rejected_than_the_gate_says() -> None:
    generator = np.random.default_rng(3)
    pose, check, rejected, count = HERE, check_at(HERE), 0, 6_000
    gate = -2.0 * math.log(0.01)
    for k in range(count):
        pose = advance(pose, OWN.v2, OWN.u2, DT)
        x, y, turned = (generator.standard_normal(3) * [3e-4, 3e-4, 3.5e-3]).tolist()
        v, u = (generator.standard_normal(2) * [2e-3, 1e-2]).tolist()
        measured = FollowerMotion(OWN.v2 + v, OWN.u2 + u, 5e-3, 3e-2)
        seen = at(Pose(pose.x + x, pose.y + y, pose.theta + turned), (0.0, float(k)))
        check, cause = checked(carried(check, measured, measured, DT), seen, NOISE, gate, True)
        rejected += cause != BELIEVED
    assert 0.0 < rejected / count < 0.014


def test_the_causes_are_counted_by_words() -> None:
    assert [cause.word for cause in Cause] == [
        "", "gated", "follower_outlier", "flipped_heading", "swapped", "frozen", "wrong_mount"
    ]  # fmt: skip


def test_what_carries_a_pose_makes_it_uncertain_by_noise_slip_and_change() -> None:
    """By hand, at a mean of 0.2 m/s and -1 rad/s that change by 0.1 m/s and 0.4 rad/s, over half a second."""
    check = check_at(HERE)._replace(sd_position=0.001, sd_heading=0.01)
    before, after = FollowerMotion(0.15, -0.8, 0.005, 0.03), FollowerMotion(0.25, -1.2, 0.004, 0.02)
    sd_heading = 0.01 + 0.5 * (0.03 + 0.1 + 0.2)
    for first, second in ((before, after), (after, before)):
        found = carried(check, first, second, 0.5)
        assert found.pose == pytest.approx(advance(HERE, 0.2, -1.0, 0.5), abs=1e-15)
        assert found.sd_heading == pytest.approx(sd_heading)
        assert found.sd_position == pytest.approx(0.001 + 0.5 * (0.005 + 0.02 + 0.05 + 0.2 * sd_heading))
    # Driving back and turning the other way is as uncertain as driving on.
    first, second = (each._replace(v2=-each.v2, u2=-each.u2) for each in (before, after))
    assert carried(check, first, second, 0.5)[2:4] == pytest.approx(carried(check, before, after, 0.5)[2:4])


def test_a_misfit_is_the_square_of_standard_deviations_the_larger_of_place_and_heading() -> None:
    check = check_at(HERE)._replace(sd_position=0.003, sd_heading=0.04)
    noise = PoseNoise(0.001, 0.01)
    place, heading = 2.0 * 0.001**2 + 0.003**2, 2.0 * 0.01**2 + 0.04**2
    aside = Pose(HERE.x + 0.006, HERE.y - 0.008, HERE.theta + 0.03)
    assert position_misfit(check, aside.x, aside.y, noise) == pytest.approx(1e-4 / place)
    assert heading_misfit(check, aside.theta, noise) == pytest.approx(9e-4 / heading)
    assert misfit(check, aside, noise) == pytest.approx(1e-4 / place)
    turned = Pose(HERE.x + 1e-4, HERE.y, HERE.theta - 2.0 * math.pi + 0.5)
    assert misfit(check, turned, noise) == pytest.approx(0.25 / heading)


def test_where_there_is_no_noise_only_the_very_pose_fits() -> None:
    exact = PoseNoise(0.0, 0.0)
    assert misfit(check_at(HERE), HERE, exact) == 0.0
    for other in (HERE._replace(y=HERE.y + 1e-9), HERE._replace(theta=HERE.theta - 1e-9)):
        assert misfit(check_at(HERE), other, exact) == math.inf


@pytest.mark.parametrize("leader", [(LEADER[0] + 0.01, LEADER[1]), (LEADER[0], LEADER[1] + 0.01)])
def test_a_leader_that_drives_along_an_axis_has_not_frozen(leader: tuple[float, float]) -> None:
    check = carried(check_at(HERE), OWN, OWN, DT)
    assert judged(at(THERE, leader), check, leader_moves=True) == BELIEVED


def test_a_frozen_leader_stays_so_though_it_seems_to_stand_until_its_place_changes() -> None:
    check = carried(check_at(HERE), OWN, OWN, DT)
    check, cause = checked(check, at(THERE), NOISE, GATE, True)
    assert (cause, check.leader_frozen) == (Cause.FROZEN, True)
    check, cause = checked(carried(check, STANDS, STANDS, DT), at(THERE), NOISE, GATE, False)
    assert cause == Cause.FROZEN
    moved = (LEADER[0], LEADER[1] + 1e-6)
    check, cause = checked(carried(check, STANDS, STANDS, DT), at(THERE, moved), NOISE, GATE, False)
    assert (cause, check.leader_frozen) == (BELIEVED, False)


@pytest.mark.parametrize("part", ["x", "y", "theta"])
def test_a_pose_that_repeats_in_part_is_a_new_one(part: str) -> None:
    """The rest of it takes the place of what was carried on."""
    check = carried(check_at(HERE, (9.0, 9.0)), STANDS, STANDS, DT)
    seen = HERE._replace(**{part: getattr(HERE, part) + 1e-9})
    after = checked(check, at(seen), NOISE, GATE, False).check
    assert (after.pose, after.sd_position, after.sd_heading) == (seen, 0.0, 0.0)
    again = checked(check, at(HERE), NOISE, GATE, False).check
    assert again.sd_position == check.sd_position > 0.0


def test_a_heading_turned_round_where_the_place_is_wrong_too_is_an_outlier() -> None:
    off = THERE._replace(x=THERE.x + 0.05, theta=THERE.theta + math.pi)
    assert judged(at(off)) == Cause.FOLLOWER
