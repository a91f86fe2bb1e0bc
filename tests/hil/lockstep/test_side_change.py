"""Orders to change sides, from the wire to the robots."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from formation.station import Side
from hil.errors import UsageError
from hil.judge.run_data import run_data_of_log
from hil.judge.summary import summarise
from hil.judge.true_states import TrueStates
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.nodes.controller import ControllerNode, ControllerState
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario, refuse_unrunnable
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire.events import Event
from hil.wire.messages import encode

GENTLE, HARD = load_scenario("changing-sides"), load_scenario("turtlebot3")


def told(scenario: Scenario, *payloads: bytes) -> ControllerState:
    node = ControllerNode(scenario)
    state = node.begin(EPOCH_NS)
    for payload in payloads:
        state, out = node.step(state, Event(node.topics.side, payload), EPOCH_NS)
        assert out == (), "an order alone moves nobody"
    return state


def order(word: str) -> bytes:
    return encode(msg.String(data=word))


def test_the_last_order_counts() -> None:
    assert told(GENTLE, order("left")).station.ordered is Side.LEFT
    assert told(GENTLE, order("left"), order("right")).station.ordered is Side.RIGHT


def test_what_is_no_side_is_refused_and_counted() -> None:
    state = told(GENTLE, order("left"), order("starboard"), b"\x00\x01\x00", order("Left"))
    assert state.station.ordered is Side.LEFT
    assert dict(state.refused) == {"unknown_side": 2, "malformed": 1}


def test_beside_a_leader_that_may_turn_too_hard_no_change_is_begun() -> None:
    state = told(HARD, order("right"), order("left"))
    assert state.station.ordered is Side.RIGHT
    assert dict(state.refused) == {"unsafe_side_change": 1}


def test_a_chain_is_not_told_to_change() -> None:
    with pytest.raises(UsageError, match="change_sides_at_s is for a pair"):
        refuse_unrunnable(load_scenario("chain5-turtlebot3", ["formation.change_sides_at_s=[1.0]"]))


@pytest.mark.slow
def test_a_driven_pair_changes_sides_as_without_noise_and_replays_bit_for_bit(tmp_path: Path) -> None:
    times = ["run.duration_s=17.0", "run.evaluate_from_s=14.5", "formation.change_sides_at_s=[1.0, 2.0, 3.0]"]
    run_lockstep(load_scenario("changing-sides", times), tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap")
    run_data = run_data_of_log(log)
    assert [each.side for each in run_data.orders] == [Side.LEFT, Side.RIGHT, Side.LEFT]
    truth = TrueStates.of(run_data.truth)
    assert np.min(truth.rho) > 0.7 * GENTLE.formation.rho_0
    assert truth.alpha1[-1] == pytest.approx(0.5 * math.pi, abs=0.5)
    assert truth.alpha2[-1] == pytest.approx(-0.5 * math.pi, abs=0.1)
    off = summarise(run_data)["formation"]["orbit_deviation_rms"]
    assert off["rho"] < 0.04 * GENTLE.formation.rho_0
    assert off["alpha1"] < math.radians(3.0)
    again = replay(log)
    assert again.mismatched == 0
    assert again.parity["commands"].compared > 1000
