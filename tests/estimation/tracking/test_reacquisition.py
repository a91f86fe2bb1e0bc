from __future__ import annotations

import math

import pytest

from estimation.filters.belief import Model
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import speed_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, mean_motion
from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body,
    measure_body_from_mocap,
    measure_world,
)
from estimation.tracking.follower_check import check_from
from estimation.tracking.reacquisition import joined, jumped, line_turn
from estimation.tracking.track_point import JumpUncertainty, TentativeTrack, no_tentative
from formation.pose import Pose, advance

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
NOISE = PoseNoise(3e-4, 3.5e-3)
GATE = 18.42
STEP_NS = 10_000_000
OWN = FollowerMotion(0.1, 0.5, 5e-3, 3e-2)
HERE = Pose(0.5, 0.1, 3.1)


def estimator(front_end: FrontEnd = FrontEnd.WORLD) -> Filter:
    return filter_of(Kind.EKF, Model(front_end, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5)))


def frame(k: int, *, aside: float = 0.0, follower_aside: float = 0.0) -> Measurement:
    """The k-th frame of a leader that drives along x at 0.05 m/s, and of a follower on its arc."""
    pose = advance(HERE, OWN.v2, OWN.u2, k * STEP_NS * 1e-9)
    leader = (0.2 + 5e-4 * k, 0.3 + aside)
    return measure_world(k * STEP_NS, leader, pose._replace(y=pose.y + follower_aside), NOISE, OWN)


def sighting(k: int, rho: float = 0.4) -> Measurement:
    return measure_body(k * STEP_NS, rho, 1.0, 1e-3, 1e-3, OWN)


def together(*measurements: Measurement, of: Filter | None = None) -> TentativeTrack:
    of = of or estimator()
    tentative = no_tentative(of.start(measurements[0]))
    for measurement in measurements:
        tentative = joined(tentative, measurement, of, GATE)
    return tentative


def test_measurements_that_agree_are_filtered_into_one_track() -> None:
    of, found = estimator(), together(*map(frame, range(4)))
    belief = of.start(frame(0))
    for k in range(1, 4):
        belief = of.step(belief, STEP_NS * 1e-9, mean_motion(OWN, OWN), frame(k), math.inf).belief
    assert found == TentativeTrack(belief, 3 * STEP_NS, OWN, 4, True, frame(3).seen.follower)


@pytest.mark.parametrize("last", [frame(3, aside=0.05), frame(3, follower_aside=0.05)])
def test_one_that_does_not_agree_begins_another(last: Measurement) -> None:
    found, alone = together(*map(frame, range(3)), last), together(last)
    assert found._replace(belief=alone.belief) == alone
    assert found.belief._replace(vx=0.0, vy=0.0) == alone.belief
    assert alone.frames == 1


@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_a_leader_faster_than_any_was_said_to_be_agrees_with_itself_from_the_third_on(
    front_end: FrontEnd,
) -> None:
    """Thirty times k_v, before a follower that drives and turns."""
    of, dt, speed = estimator(front_end), STEP_NS * 1e-9, 30.0 * LIMITS.k_v
    measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
    seen = [
        measure(k * STEP_NS, (speed * k * dt, 0.3), advance(HERE, OWN.v2, OWN.u2, k * dt), NOISE, OWN)
        for k in range(6)
    ]
    assert [together(*seen[: k + 1], of=of).frames for k in range(6)] == [1, 1, 2, 3, 4, 5]
    assert speed_of(together(*seen, of=of).belief) == pytest.approx(speed, rel=0.05)


def test_a_follower_is_expected_where_its_motion_leads_in_the_time_that_has_passed() -> None:
    assert together(frame(0), frame(60)).frames == 2
    assert together(frame(0), frame(60)._replace(capture_ns=STEP_NS)).frames == 1


def test_sightings_have_no_pose_of_the_follower_to_agree_with() -> None:
    body = estimator(FrontEnd.BODY)
    assert together(sighting(0), sighting(1), sighting(2), of=body).frames == 3
    pose = Pose(-0.4 * math.cos(1.0), -0.4 * math.sin(1.0), 0.0)
    framed = measure_body_from_mocap(STEP_NS, (0.0, 0.0), pose, NOISE, OWN)
    for order in ((sighting(0), framed), (framed._replace(capture_ns=0), sighting(1))):
        found = together(*order, of=body)
        assert (found.frames, found.framed) == (2, order[-1].framed)


def moved(*, leader: tuple[float, float] = (0.0, 0.0), pose: Pose = HERE) -> Measurement:
    return measure_world(7_000, (0.2 + leader[0], 0.3 + leader[1]), pose, NOISE, OWN)


def test_a_jump_adds_up_the_ways_of_both_robots_and_the_turn_of_the_follower() -> None:
    prior, check, before = estimator().start(frame(0)), check_from(frame(0)), JumpUncertainty(0.5, 0.25, 3)
    there = moved(leader=(0.03, -0.04), pose=Pose(HERE.x - 0.06, HERE.y + 0.08, -3.1))
    turned = 2.0 * (math.pi - 3.1)
    both = jumped(before, there, prior, check, leader_fits=False)
    assert both == pytest.approx((0.65, 0.25 + turned, 7_000))
    follower = jumped(before, there, prior, check, leader_fits=True)
    assert follower == pytest.approx((0.6, 0.25 + turned, 7_000))
    for unknown in (
        jumped(before, there, prior, check._replace(known=False), leader_fits=False),
        jumped(before, there._replace(framed=False), prior, check, leader_fits=False),
    ):
        assert unknown == pytest.approx((0.55, 0.25, 7_000))


@pytest.mark.parametrize("front_end", FrontEnd)
def test_a_jump_turns_the_line_by_its_way_over_the_distance_and_by_its_turn(front_end: FrontEnd) -> None:
    measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
    far = measure(0, (HERE.x + 0.3, HERE.y - 0.4), HERE, NOISE, OWN)
    assert line_turn(JumpUncertainty(0.05, 0.2, 0), far) == pytest.approx(0.2 + 0.05 / 0.5)


def test_in_one_place_a_line_may_have_turned_anywhere() -> None:
    here = measure_world(0, (HERE.x, HERE.y), HERE, NOISE, OWN)
    assert line_turn(JumpUncertainty(0.0, 0.0, 0), here) == math.inf
