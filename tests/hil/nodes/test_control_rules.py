from __future__ import annotations

from controllers.resolution import Steps
from hil.nodes.control_rules import control_rules
from hil.nodes.leader_turn import TurnSource
from hil.scenario.files import load_scenario

MS = 1_000_000


def test_times_are_those_of_the_scenario_and_a_command_acts_after_its_way_and_the_lag() -> None:
    given = ["lag_s=0.07", "transport_s=0.02", "tick_hz=40", "max_age_s=0.15", "law=faded"]
    rules = control_rules(load_scenario("turtlebot3", [f"controller.{each}" for each in given]))
    assert (rules.lag, rules.transport_ns, rules.ahead_ns) == (0.07, 20 * MS, 90 * MS)
    assert (rules.tick_ns, rules.max_age_ns, rules.follower.max_age) == (25 * MS, 150 * MS, 0.15)
    assert rules.turn_source == TurnSource.FADED


def test_law_limits_and_steps_are_those_of_the_scenario() -> None:
    given = ["v_max=0.3", "u_max=1.5", "v_resolution=0.01", "u_resolution=0.02", "law=ideal"]
    scenario = load_scenario("turtlebot3", [f"controller.{each}" for each in given])
    follower = control_rules(scenario).follower
    assert (follower.keeper.law.v_max, follower.keeper.law.u_max) == (0.3, 1.5)
    assert follower.keeper.law.rho_0 == scenario.formation.rho_0
    assert follower.steps == Steps(0.01, 0.02)
    assert follower.keeper.knows_turn
    assert control_rules(scenario).turn_source == TurnSource.TOLD
    plain = control_rules(load_scenario("turtlebot3"))
    assert not plain.follower.keeper.knows_turn
    assert plain.turn_source == TurnSource.NOWHERE
