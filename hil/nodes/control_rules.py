"""What a controller goes by, out of a scenario."""

from __future__ import annotations

from controllers.follower import FollowerSettings
from controllers.resolution import Resolution
from hil.nodes.controller_step import ControlRules
from hil.nodes.leader_turn import source_of
from hil.scenario.parts import station_keeper, turn_prediction
from hil.scenario.schema import Scenario

_NS = 1e-9


def control_rules(scenario: Scenario) -> ControlRules:
    """Rules of the controller of a scenario's follower."""
    given = scenario.controller
    steps = Resolution(given.v_resolution, given.u_resolution).steps
    transport_ns = round(given.transport_s / _NS)
    return ControlRules(
        follower=FollowerSettings(station_keeper(scenario).settings, steps, given.max_age_s),
        turn_prediction=turn_prediction(scenario),
        turn_source=source_of(given.law).value,
        lag=given.lag_s,
        transport_ns=transport_ns,
        ahead_ns=transport_ns + round(given.lag_s / _NS),
        tick_ns=round(1.0 / given.tick_hz / _NS),
        max_age_ns=round(given.max_age_s / _NS),
    )
