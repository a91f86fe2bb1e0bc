from __future__ import annotations

from formation.station import Side
from hil.scenario.files import load_scenario
from hil.scenario.ordered_sides import ordered_sides, refusal


def test_orders_lead_to_and_fro_in_the_order_of_their_times() -> None:
    scenario = load_scenario(
        "changing-sides", ["formation.change_sides_at_s=[7.0, 2.0, 5.0]", "formation.side=left"]
    )
    assert ordered_sides(scenario) == ((2.0, Side.RIGHT), (5.0, Side.LEFT), (7.0, Side.RIGHT))


def test_why_orders_will_be_refused_is_told_with_what_to_do() -> None:
    orders = "formation.change_sides_at_s=[1.0]"
    assert refusal(load_scenario("changing-sides")) is None
    assert refusal(load_scenario("turtlebot3")) is None
    why = refusal(load_scenario("turtlebot3", [orders]))
    assert why is not None
    assert "leader.k_u is 0.7 rad/s, expected at most 0.4 k_v / rho_0 = 0.2" in why
    assert refusal(load_scenario("turtlebot3", [orders, "leader.k_u=0.2"])) is None
