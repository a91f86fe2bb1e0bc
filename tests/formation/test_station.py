from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion, Pose
from formation.shape import Shape, follower_pose, shape_rates
from formation.station import ABREAST, Side, Station

stations = st.builds(Station, st.sampled_from(Side), st.floats(0.01, 3.13))


@given(stations, st.floats(0.1, 5.0), st.floats(-3.0, 3.0), st.floats(0.05, 1.0))
def test_at_its_station_a_follower_drives_parallel_to_a_straight_leader(
    station: Station, rho: float, heading: float, v: float
) -> None:
    shape = Shape(rho, station.alpha1, station.alpha2)
    follower = follower_pose(shape, Pose(0.0, 0.0, heading))
    assert math.cos(follower.theta - heading) == pytest.approx(1.0, abs=1e-12)
    to_the_left = math.cos(heading) * follower.y - math.sin(heading) * follower.x
    assert (to_the_left > 0.0) is (station.side is Side.LEFT)
    rates = shape_rates(shape, Motion(v, 0.0), Motion(v, 0.0))
    assert (rates.rho_dot, rates.alpha1_dot, rates.alpha2_dot) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_abreast_on_the_right_is_the_papers_and_exact() -> None:
    assert (ABREAST.alpha1, ABREAST.alpha2) == (-math.pi / 2, math.pi / 2)
    assert (ABREAST.cos, ABREAST.sin, ABREAST.sign) == (0.0, 1.0, 1.0)
    left = Station(Side.LEFT)
    assert (left.alpha1, left.alpha2, left.sin) == (math.pi / 2, -math.pi / 2, -1.0)


@pytest.mark.parametrize("bearing", [0.0, -1.0, math.pi, math.nan])
def test_in_line_ahead_there_is_no_station(bearing: float) -> None:
    with pytest.raises(ValueError, match="bearing"):
        Station(Side.RIGHT, bearing)


@given(stations, st.floats(-10.0, 10.0))
def test_off_the_station_by_an_angle_is_off_abreast_by_it(station: Station, alpha1: float) -> None:
    off = station.offset(alpha1)
    assert -math.pi < off <= math.pi
    assert math.sin(off) == pytest.approx(math.sin(alpha1 - station.alpha1), abs=1e-12)
    assert math.cos(off) == pytest.approx(math.cos(alpha1 - station.alpha1), abs=1e-12)
    assert math.cos(alpha1 + station.to_abreast) == pytest.approx(math.sin(off), abs=1e-12)
    assert (station.cos, station.sin) == pytest.approx((math.cos(station.alpha2), math.sin(station.alpha2)))
    assert ABREAST.to_abreast == 0.0


def test_sides_are_known_by_their_signs_and_are_each_others_other() -> None:
    assert [(side, side.sign, side.other) for side in Side] == [
        (Side.RIGHT, 1.0, Side.LEFT),
        (Side.LEFT, -1.0, Side.RIGHT),
    ]
    assert [Side.of(side.sign) for side in Side] == list(Side)
