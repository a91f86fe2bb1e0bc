from __future__ import annotations

import math

import numpy as np

from formation.station import Side
from hil.judge.side_orders import Order, desired_bearings, orders_of
from hil.scenario.files import load_scenario
from hil.wire.message_types import String

GENTLE, HARD = load_scenario("changing-sides"), load_scenario("turtlebot3")
SENT = [(20, String(data="left")), (30, String(data="port")), (40, String(data="right"))]


def test_orders_that_the_controller_refuses_are_none() -> None:
    assert orders_of(GENTLE, SENT) == (Order(20, Side.LEFT), Order(40, Side.RIGHT))
    assert orders_of(HARD, SENT) == ()


def test_the_station_is_that_of_the_last_order() -> None:
    moments = np.array([0, 19, 20, 39, 40, 99])
    alpha1, alpha2 = desired_bearings(GENTLE, orders_of(GENTLE, SENT), moments)
    signs = np.array([1, 1, -1, -1, 1, 1])
    np.testing.assert_allclose(alpha1, -0.5 * math.pi * signs)
    np.testing.assert_allclose(alpha2, 0.5 * math.pi * signs)
