from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from formation.station import Side
from hil.judge.run_data import run_data_of_link
from hil.judge.side_orders import Order, desired_bearings, orders_of
from hil.log.metadata import log_metadata
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.wire.message_types import String
from hil.wire.messages import encode, typename_of
from hil.wire.topics import link_topics

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


def test_in_a_chain_nobody_is_judged_by_orders(tmp_path: Path) -> None:
    """An order that comes by mistake moves no follower of a chain; its station stays what it was."""
    chain = load_scenario("chain5-turtlebot3", ["leader.k_u=0.1"])
    link = links_of(chain)[0]
    with LogWriter(tmp_path / "chain.mcap", log_metadata(chain, "live")) as out:
        order = encode(String(data="left"))
        out.write(link_topics(link).side, typename_of(String), order, 1, 1)
    log = read_log(tmp_path / "chain.mcap")
    assert run_data_of_link(log, link).orders == ()
    assert run_data_of_link(log, replace(link, in_chain=False)).orders == (Order(1, Side.LEFT),)
