"""The entries of the controller: what they make of a message, and what they put into theirs."""

from __future__ import annotations

import numpy as np
import pytest

from controllers.follower import Command
from estimation.tracking.prediction import Reported
from estimation.tracking.tracker import Status
from formation.records import load, store
from hil.nodes.controller import ControllerNode, ControllerState
from hil.nodes.controller_desk import MALFORMED, STOPS, UNKNOWN_SIDE
from hil.nodes.controller_entries import control, hear, hear_estimate, refuse
from hil.nodes.controller_events import NOTHING, TICK, ControlEvent, Happening
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.cdr import packed_texts
from hil.wire.messages import decode_as, encode, header, to_ns, to_time

MS = 1_000_000
NOW_NS = 1_000_000 * MS
NODE = ControllerNode(load_scenario("turtlebot3"))
TEXTS = packed_texts(["", *STOPS])


def estimate(status: int = Status.TRACKING.value) -> bytes:
    """An estimate in which no two numbers are the same."""
    return encode(
        msg.LeaderEstimate(
            header=header(NOW_NS - 30 * MS, "follower"),
            measured=to_time(NOW_NS - 40 * MS),
            computed=to_time(NOW_NS - 20 * MS),
            rho=0.25,
            alpha2=1.5,
            rho_dot=0.001,
            alpha2_dot=0.002,
            v1=0.08,
            alpha1=-1.5,
            u1=0.3,
            v2=0.1,
            u2=0.2,
            covariance=1e-3 * np.arange(25.0),
            nis=1.0,
            status=status,
            reason="",
            bound_v1=0.01,
            bound_alpha1=0.11,
            bound_h=0.5,
            consumed=[],
        )
    )


def decision(state: ControllerState, now_ns: int) -> msg.Command | None:
    length = control(state.lent, TEXTS, now_ns)
    return decode_as(NODE.decision.payload(length), msg.Command) if length else None


def event_of(state: ControllerState) -> ControlEvent:
    return load(ControlEvent, state.desk.event, 0)


def test_an_estimate_is_put_down_by_what_a_command_takes_from_it() -> None:
    state = NODE.begin(NOW_NS)
    assert hear_estimate(state.lent, estimate(Status.COASTING.value), 7, NOW_NS)
    # Of the covariance, by rows, the variance of u1 is the last, its covariance with alpha1 the 20th.
    numbers = Reported(NOW_NS - 30 * MS, NOW_NS - 40 * MS, 0.25, 1.5, 0.08, -1.5, 0.3, 0.024, 0.1, 0.2, 0.019)
    assert event_of(state) == ControlEvent(Happening.ESTIMATE.value, Status.COASTING.value, 0.0, numbers)


@pytest.mark.parametrize("payload", [b"", estimate()[:-5], estimate(77)])
def test_what_is_no_estimate_has_a_receipt_and_says_nothing(payload: bytes) -> None:
    state = NODE.begin(NOW_NS)
    store(state.desk.event, 0, TICK)
    assert not hear_estimate(state.lent, payload, 7, NOW_NS)
    assert event_of(state) == NOTHING
    assert decision(state, NOW_NS) is None
    assert [tuple(each) for each in state.receipts] == [(7, NOW_NS)]


def test_a_decision_tells_what_it_rests_on_and_the_drive_command_is_what_was_decided() -> None:
    state = NODE.begin(NOW_NS)
    for digest in (5, 6):
        hear(state.lent, digest, NOW_NS - digest * MS)
    hear_estimate(state.lent, estimate(), 7, NOW_NS - MS)
    made = decision(state, NOW_NS)
    assert made is not None
    assert (to_ns(made.header.stamp), made.stop, made.fresh) == (NOW_NS, "", True)
    assert (to_ns(made.capture), to_ns(made.measured)) == (NOW_NS - 30 * MS, NOW_NS - 40 * MS)
    received = [(each.digest, to_ns(each.received)) for each in made.consumed]
    assert received == [(5, NOW_NS - 5 * MS), (6, NOW_NS - 6 * MS), (7, NOW_NS - MS)]
    decided = load(Command, state.desk.result, 0)
    assert (made.v2, made.u2) == (decided.v, decided.u)
    assert (made.v2_wanted, made.u2_wanted) == (decided.v_wanted, decided.u_wanted)
    assert made.saturated == decided.saturated
    driven = decode_as(NODE.drive.buffer.tobytes(), msg.TwistStamped)
    assert (driven.twist.linear.x, driven.twist.angular.z) == (decided.v, decided.u)
    assert to_ns(driven.header.stamp) == NOW_NS
    assert (state.receipts, state.decided) == ((), {"driving": 1})


def test_before_any_estimate_a_decision_rests_on_none() -> None:
    state = NODE.begin(NOW_NS)
    made = decision(state, NOW_NS)
    assert made is not None
    assert (made.stop, made.fresh, to_ns(made.capture), to_ns(made.measured)) == ("no estimate", False, 0, 0)
    hear_estimate(state.lent, estimate(Status.COASTING.value), 7, NOW_NS)
    made = decision(state, NOW_NS)
    assert made is not None
    assert (made.stop, made.fresh, to_ns(made.capture), to_ns(made.measured)) == ("no estimate", False, 0, 0)
    assert state.decided == {"no estimate": 2}


def test_inputs_are_refused_under_their_own_names() -> None:
    state = NODE.begin(NOW_NS)
    for cause in (UNKNOWN_SIDE, MALFORMED, UNKNOWN_SIDE):
        refuse(state.lent, cause)
    assert state.refused == {"malformed": 1, "unknown_side": 2}
