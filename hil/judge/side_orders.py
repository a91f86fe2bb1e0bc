"""Orders to change sides, as a run's judge sees them: which were given when, and the station they ask for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from formation.angles import FloatArray
from formation.station import Side, Station
from hil.judge.true_states import Stamps
from hil.scenario.parts import may_change_sides, station
from hil.scenario.schema import Scenario
from hil.wire.message_types import String


@dataclass(frozen=True, slots=True)
class Order:
    """An order to drive on a side of the leader, and when it was given."""

    given_ns: int
    side: Side


def orders_of(scenario: Scenario, given: Sequence[tuple[int, String]]) -> tuple[Order, ...]:
    """Orders out of what was sent, without those that the controller refuses."""
    if not may_change_sides(scenario):
        return ()
    words = {side.value: side for side in Side}
    return tuple(Order(given_ns, words[text.data]) for given_ns, text in given if text.data in words)


def desired_bearings(
    scenario: Scenario, orders: Sequence[Order], moments_ns: Stamps
) -> tuple[FloatArray, FloatArray]:
    """(alpha1, alpha2) of the station that was ordered last at each of the moments."""
    first = station(scenario)
    stations = [first, *(Station(order.side, first.bearing) for order in orders)]
    which = np.searchsorted([order.given_ns for order in orders], moments_ns, side="right")
    return (
        np.array([each.alpha1 for each in stations])[which],
        np.array([each.alpha2 for each in stations])[which],
    )
