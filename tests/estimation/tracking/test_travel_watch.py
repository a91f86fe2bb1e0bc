"""A leader that turns back is noticed, and one that merely turns, or is not seen for a while, is not."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import LeaderLimits
from estimation.tracking.travel_watch import NO_TRAVEL, TravelWatch, travelled

LIMITS = LeaderLimits(0.04, 0.2, 1.0)
FRAME_NS = 10_000_000


def watched(
    velocities: Iterable[tuple[float, float]], watch: TravelWatch = NO_TRAVEL, frame_ns: int = FRAME_NS
) -> TravelWatch:
    """Watch over velocities [m/s] that are told a frame apart, settled where they are not slow."""
    for number, (vx, vy) in enumerate(velocities, start=1):
        belief = Gaussian.of(np.array([0.0, 0.0, vx, vy, 0.0]), np.eye(5))
        watch = travelled(watch, belief, watch.at_ns + number * frame_ns, math.hypot(vx, vy) >= 0.04, LIMITS)
    return watch


def test_a_leader_that_goes_back_through_a_standstill_has_turned_back() -> None:
    watch = watched([(0.01 * speed, 0.002) for speed in range(8, -7, -1)])
    assert watch.turned_ns > 0
    assert watch.vx < 0.0
    assert watched([(-0.07, 0.0)] * 5, watch).turned_ns == watch.turned_ns


def test_a_cusp_between_two_frames_is_one_too() -> None:
    assert watched([(0.08, 0.0), (-0.08, 0.01)]).turned_ns > 0


@pytest.mark.parametrize("turn", [0.01, -0.05])
def test_a_leader_that_turns_round_at_speed_has_not(turn: float) -> None:
    circle = [(0.08 * math.cos(turn * k), 0.08 * math.sin(turn * k)) for k in range(700)]
    assert watched(circle).turned_ns == 0


def test_a_leader_that_stops_and_goes_on_has_not() -> None:
    speeds = [0.08, 0.05, 0.03, 0.001, -0.001, 0.002, 0.03, 0.06, 0.08]
    assert watched([(speed, 0.01 * speed) for speed in speeds]).turned_ns == 0


def test_where_it_may_have_turned_unseen_nothing_is_said() -> None:
    watch = watched([(0.08, 0.0)])
    assert watched([(-0.08, 0.0)], watch, frame_ns=1_500_000_000).turned_ns == 0
    assert watched([(-0.08, 0.0)], watch, frame_ns=900_000_000).turned_ns > 0
    # Unless it was seen to stand.
    assert watched([(0.01, 0.0), (-0.08, 0.0)], watch, frame_ns=1_500_000_000).turned_ns > 0


def test_nothing_is_said_of_a_direction_that_was_never_sure() -> None:
    belief = Gaussian.of(np.array([0.0, 0.0, 0.08, 0.0, 0.0]), np.eye(5))
    unsure = travelled(NO_TRAVEL, belief, FRAME_NS, False, LIMITS)
    assert unsure == NO_TRAVEL
    assert watched([(0.0, 0.0), (-0.08, 0.0)], unsure).turned_ns == 0
