"""A leader that turns back is noticed, and one that merely turns, or is not seen for a while, is not."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import LeaderLimits
from estimation.tracking.estimate import Estimate, guessed_when_slow
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.travel_watch import NO_TRAVEL, TravelWatch, direction_watched, travel_watched
from formation.kernel import entry, interpreted
from formation.pose import Motion
from formation.records import Rows, copy_of, load, row_of, rows_of, size, store
from hil.emulator.robot import Robot, Travel, travelling
from tests.bits import same_bits

LIMITS = LeaderLimits(0.04, 0.2, 1.0)
FRAME_NS = 10_000_000


def gone(
    velocities: Iterable[tuple[float, float]], watch: TravelWatch = NO_TRAVEL, frame_ns: int = FRAME_NS
) -> TravelWatch:
    """Watch over velocities [m/s] that are told a frame apart, settled where they are not slow."""
    for number, (vx, vy) in enumerate(velocities, start=1):
        belief = Gaussian.of(np.array([0.0, 0.0, vx, vy, 0.0]), np.eye(5))
        watch = direction_watched(
            watch, belief, watch.at_ns + number * frame_ns, math.hypot(vx, vy) >= 0.04, LIMITS
        )
    return watch


def test_a_leader_that_goes_back_through_a_standstill_has_turned_back() -> None:
    watch = gone([(0.01 * speed, 0.002) for speed in range(8, -7, -1)])
    assert watch.turned_ns > 0
    assert watch.vx < 0.0
    assert gone([(-0.07, 0.0)] * 5, watch).turned_ns == watch.turned_ns


def test_a_cusp_between_two_frames_is_one_too() -> None:
    assert gone([(0.08, 0.0), (-0.08, 0.01)]).turned_ns > 0


@pytest.mark.parametrize("turn", [0.01, -0.05])
def test_a_leader_that_turns_round_at_speed_has_not(turn: float) -> None:
    circle = [(0.08 * math.cos(turn * k), 0.08 * math.sin(turn * k)) for k in range(700)]
    assert gone(circle).turned_ns == 0


def test_a_leader_that_stops_and_goes_on_has_not() -> None:
    speeds = [0.08, 0.05, 0.03, 0.001, -0.001, 0.002, 0.03, 0.06, 0.08]
    assert gone([(speed, 0.01 * speed) for speed in speeds]).turned_ns == 0


def test_where_it_may_have_turned_unseen_nothing_is_said() -> None:
    watch = gone([(0.08, 0.0)])
    assert gone([(-0.08, 0.0)], watch, frame_ns=1_500_000_000).turned_ns == 0
    assert gone([(-0.08, 0.0)], watch, frame_ns=900_000_000).turned_ns > 0
    # Unless it was seen to stand.
    assert gone([(0.01, 0.0), (-0.08, 0.0)], watch, frame_ns=1_500_000_000).turned_ns > 0


def test_nothing_is_said_of_a_direction_that_was_never_sure() -> None:
    belief = Gaussian.of(np.array([0.0, 0.0, 0.08, 0.0, 0.0]), np.eye(5))
    unsure = direction_watched(NO_TRAVEL, belief, FRAME_NS, False, LIMITS)
    assert unsure == NO_TRAVEL
    assert gone([(0.0, 0.0), (-0.08, 0.0)], unsure).turned_ns == 0


@entry
def followed(watches: Rows[TravelWatch], points: Rows[TrackPoint], limits: Rows[LeaderLimits]) -> None:
    watch, given = load(TravelWatch, watches, 0), load(LeaderLimits, limits, 0)
    for k in range(size(points)):
        watch = travel_watched(watch, load(TrackPoint, points, k), 1.0, given)
        store(watches, k, watch)


@entry
def humbled(estimates: Rows[Estimate], v_eps: float) -> None:
    for k in range(size(estimates)):
        store(estimates, k, guessed_when_slow(load(Estimate, estimates, k), v_eps))


@entry
def way_gone(robots: Rows[Robot], found: Rows[Travel]) -> None:
    for k in range(size(robots)):
        store(found, k, travelling(load(Robot, robots, k)))


def test_compiled_and_plain_give_the_same_bits() -> None:
    speeds = [0.08, 0.05, 0.01, -0.01, -0.03, -0.06, -0.07, -0.07]
    verdicts = [0, 0, 1, 0, 0, 2, 2, 0]
    points, estimates, robots = rows_of(TrackPoint, 8), rows_of(Estimate, 8), rows_of(Robot, 8)
    for k, (speed, verdict) in enumerate(zip(speeds, verdicts, strict=True)):
        point = load(TrackPoint, points, k)
        belief = point.belief._replace(vx=speed, vy=0.3 * speed)
        measurement = point.measurement._replace(capture_ns=1_000 + k * 200_000_000)
        settled = abs(speed) > 0.04 and verdict != 2
        store(
            points,
            k,
            point._replace(belief=belief, measurement=measurement, verdict=verdict, settled=settled),
        )
        store(estimates, k, load(Estimate, estimates, k)._replace(v1=abs(speed)))
        store(robots, k, load(Robot, robots, k)._replace(heading=2.0 * k, motion=Motion(speed, 0.1 * k)))
    limits = row_of(LIMITS)
    compiled = rows_of(TravelWatch, 8), copy_of(estimates), rows_of(Travel, 8)
    plain = rows_of(TravelWatch, 8), copy_of(estimates), rows_of(Travel, 8)
    followed(compiled[0], points, limits)
    interpreted(followed)(plain[0], points, limits)
    humbled(compiled[1], 0.04)
    interpreted(humbled)(plain[1], 0.04)
    way_gone(robots, compiled[2])
    interpreted(way_gone)(robots, plain[2])
    for k in range(8):
        same_bits(load(TravelWatch, compiled[0], k), load(TravelWatch, plain[0], k))
        same_bits(load(Estimate, compiled[1], k), load(Estimate, plain[1], k))
        same_bits(load(Travel, compiled[2], k), load(Travel, plain[2], k))
    assert load(TravelWatch, compiled[0], 7).turned_ns > 0
