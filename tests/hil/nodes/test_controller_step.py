"""The controller's step in numbers: compiled and interpreted, event by event."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.follower import Command, command
from controllers.guard import CLOCK_TOLERANCE_NS, StopReason
from estimation.tracking.prediction import Reported, SentCommand
from estimation.tracking.tracker import Status
from formation.kernel import interpreted
from formation.records import columns_of, load, store
from formation.ring import place
from formation.station import Side
from hil.nodes.controller import ControllerNode
from hil.nodes.controller_desk import STOPS as REASONS
from hil.nodes.controller_desk import NodeRules
from hil.nodes.controller_entries import control
from hil.nodes.controller_events import ControlEvent, Happening, happened
from hil.nodes.controller_step import (
    ControlRules,
    ControlState,
    at_time,
    can_be,
    commanded,
    outlook_at,
    standing_at,
)
from hil.scenario.files import load_scenario
from hil.wire.cdr import packed_texts

STOPS = packed_texts(["", *REASONS])
MS = 1_000_000
NOW_NS = 1_000_000 * MS
LAWS = ("independent", "ideal", "feedforward", "faded")


class Controller:
    """A controller's rows, and a step of it by one function."""

    def __init__(self, law: str, step: object = control, scenario: str = "turtlebot3") -> None:
        chosen = load_scenario(scenario, [f"controller.law={law}"])
        self.state = ControllerNode(chosen).begin(NOW_NS)
        self.desk = self.state.desk
        self.step = step

    def take(self, event: ControlEvent, now_ns: int) -> bool:
        """Whether a command came of it."""
        store(self.desk.event, 0, event)
        desk = self.state.lent if self.step is control else [self.desk]
        length: int = self.step(desk, STOPS, now_ns)  # type: ignore[operator]
        return length > 0

    @property
    def known(self) -> ControlState:
        return load(ControlState, self.desk.control, 0)

    @property
    def rules(self) -> ControlRules:
        return load(NodeRules, self.desk.rules, 0).control

    @property
    def command(self) -> Command:
        return load(Command, self.desk.result, 0)


def reported(capture_ns: int, **changes: float) -> Reported:
    sound = Reported(capture_ns, capture_ns, 0.25, 1.5, 0.08, -1.5, 0.3, 0.01, 0.1, 0.3, -0.001)
    return sound._replace(**changes)  # type: ignore[arg-type]


def estimate(capture_ns: int, status: int = Status.TRACKING.value, **changes: float) -> ControlEvent:
    return ControlEvent(Happening.ESTIMATE.value, status, 0.0, reported(capture_ns, **changes))


QUANTITIES = ("rho", "alpha2", "v1", "alpha1", "u1", "var_u1", "v2")
OTHERS = [each for each in Happening if each is not Happening.ESTIMATE]
numbers = st.one_of(st.floats(), st.floats(-2.0, 2.0))
estimates = st.builds(
    lambda age_ms, status, changes: (age_ms, status, changes),
    st.integers(-60, 250),
    st.sampled_from(Status),
    st.dictionaries(st.sampled_from(QUANTITIES), numbers, max_size=1),
)
others = st.builds(happened, st.sampled_from(OTHERS), st.just(-1.0))


@pytest.mark.parametrize("law", LAWS)
@given(steps=st.lists(st.tuples(st.integers(-5, 30), st.one_of(estimates, others)), max_size=25))
def test_compiled_and_interpreted_are_the_same(
    law: str, steps: list[tuple[int, ControlEvent | tuple[int, Status, dict[str, float]]]]
) -> None:
    one, other = (Controller(law, step, "changing-sides") for step in (control, interpreted(control)))
    now_ns = NOW_NS
    for after_ms, drawn in steps:
        now_ns += after_ms * MS
        if isinstance(drawn, ControlEvent):
            event = drawn
        else:
            age_ms, status, changes = drawn
            event = estimate(now_ns - age_ms * MS, status.value, **changes)
        assert one.take(event, now_ns) == other.take(event, now_ns)
        assert nan_free(one) == nan_free(other)


def nan_free(controller: Controller) -> str:
    """All rows in words: NaN has several forms in bytes."""
    state = load(ControlState, controller.desk.control, 0)
    commands, refused = columns_of(controller.desk.commands).tolist(), controller.state.refused
    return repr((state, controller.command, commands, refused))


@pytest.mark.parametrize("ahead_ns", [0, 40 * MS, CLOCK_TOLERANCE_NS])
def test_an_estimate_whose_stamps_are_accepted_may_move_the_robot(ahead_ns: int) -> None:
    """Stamps that message checks let pass, of a clock that is ahead, do not stop every command."""
    controller = Controller("independent")
    assert controller.take(estimate(NOW_NS + ahead_ns), NOW_NS)
    assert controller.command.stop is None


def test_a_clock_that_is_further_ahead_is_refused_by_name() -> None:
    controller = Controller("independent")
    assert not controller.take(estimate(NOW_NS + CLOCK_TOLERANCE_NS + 1), NOW_NS)
    assert controller.state.refused == {"bad_stamp": 1}
    assert controller.take(happened(Happening.TICK), NOW_NS)
    assert controller.command.stop is StopReason.NO_ESTIMATE


def test_orders_and_the_leaders_turn_rate_move_nobody() -> None:
    controller = Controller("ideal")
    assert not controller.take(happened(Happening.LEADER, 0.4), NOW_NS)
    assert load(ControlState, controller.desk.control, 0).leader_u1 == 0.4
    assert not controller.take(happened(Happening.ORDER, Side.RIGHT.sign), NOW_NS)
    assert controller.state.refused == {}
    assert not controller.take(happened(Happening.ORDER, Side.LEFT.sign), NOW_NS)
    assert controller.state.refused == {"unsafe_side_change": 1}


def test_a_clock_that_is_set_back_ends_what_is_known() -> None:
    controller = Controller("faded")
    controller.take(estimate(NOW_NS - MS), NOW_NS)
    controller.take(happened(Happening.NOTHING), NOW_NS - 10 * MS)
    state = load(ControlState, controller.desk.control, 0)
    assert (state.known, state.trend.known, state.sent.length) == (False, False, 0)
    assert math.isnan(state.leader_u1)


@pytest.mark.parametrize(
    ("gap_ns", "elapsed"),
    [(0, 1e-3), (MS // 2, 1e-3), (MS, 1e-3), (7 * MS, 7e-3), (20 * MS, 2e-2), (70 * MS, 2e-2)],
)
def test_a_command_is_for_the_time_since_the_last_one_from_a_millisecond_to_a_tick(
    gap_ns: int, elapsed: float
) -> None:
    """A change of sides under way goes on by that much."""
    controller = Controller("independent", scenario="changing-sides")
    controller.take(happened(Happening.ORDER, Side.LEFT.sign), NOW_NS)
    controller.take(estimate(NOW_NS, u1=0.0, rho=0.5), NOW_NS)
    known, rules, commands = controller.known, controller.rules, controller.desk.commands
    assert (rules.tick_ns, known.follower.station.change.arrived) == (20 * MS, False)
    now_ns = NOW_NS + gap_ns
    outlook, standing = outlook_at(known, rules, commands, now_ns), standing_at(known, now_ns)
    expected = command(known.follower, rules.follower, outlook, standing, elapsed)
    found = commanded(known, rules, commands, now_ns)
    assert (found.command, found.state.follower) == (expected.command, expected.state)
    assert (found.state.commanded_ns, found.state.next_tick_ns) == (now_ns, now_ns + 20 * MS)
    assert command(known.follower, rules.follower, outlook, standing, 1.1 * elapsed).state != expected.state


def sent(controller: Controller) -> list[SentCommand]:
    ring, commands = controller.known.sent, controller.desk.commands
    return [load(SentCommand, commands, place(ring, commands, k)) for k in range(ring.length)]


def test_commands_are_kept_from_the_one_on_its_way_at_the_capture_and_for_the_largest_age() -> None:
    controller = Controller("independent")
    transport_ns, most_ns = controller.rules.transport_ns, controller.rules.max_age_ns
    for k in range(3):
        controller.take(happened(Happening.TICK), NOW_NS + 10 * k * MS)
        # Of those before any estimate only the newest may ever matter.
        assert [each.from_ns for each in sent(controller)] == [NOW_NS + 10 * k * MS + transport_ns]
    starts = [NOW_NS + 20 * MS + transport_ns]
    for k in range(3, 60):
        now_ns = NOW_NS + 10 * k * MS
        capture_ns = now_ns - 30 * MS if k < 20 else NOW_NS + 160 * MS
        controller.take(estimate(capture_ns) if k < 20 else happened(Happening.TICK), now_ns)
        starts.append(now_ns + transport_ns)
        since_ns = max(capture_ns, now_ns - most_ns)
        begun = [each for each in starts if each <= since_ns]
        assert [each.from_ns for each in sent(controller)] == [
            *begun[-1:],
            *(each for each in starts if each > since_ns),
        ]
        newest = sent(controller)[-1]
        assert (newest.v, newest.u) == (controller.command.v, controller.command.u)


def test_what_a_command_rests_on_is_as_old_as_the_newest_measurement_in_it() -> None:
    controller = Controller("independent")
    for measured_ns in (NOW_NS - 20 * MS, NOW_NS - 50 * MS):
        told = reported(NOW_NS - 20 * MS)._replace(measured_ns=measured_ns)
        controller.take(estimate(NOW_NS)._replace(reported=told), NOW_NS)
        assert standing_at(controller.known, NOW_NS).age == pytest.approx(1e-9 * (NOW_NS - measured_ns))
    assert standing_at(controller.known, NOW_NS) == pytest.approx((0.05, True, True, False, False))
    for status, settled, lost in ((Status.INITIALISING, False, False), (Status.LOST, True, True)):
        controller.take(estimate(NOW_NS, status.value), NOW_NS)
        assert standing_at(controller.known, NOW_NS)[1:] == (True, settled, lost, False)


def test_stamps_must_be_in_the_order_of_things() -> None:
    late_ns = NOW_NS + CLOCK_TOLERANCE_NS
    for measured_ns, capture_ns, possible in (
        (NOW_NS, NOW_NS, True),
        (NOW_NS + 1, NOW_NS, False),
        (NOW_NS - 1, NOW_NS, True),
        (NOW_NS, late_ns, True),
        (NOW_NS, late_ns + 1, False),
    ):
        assert can_be(reported(capture_ns)._replace(measured_ns=measured_ns), NOW_NS) is possible


def test_only_a_clock_behind_the_last_command_was_set_back() -> None:
    controller = Controller("independent")
    controller.take(estimate(NOW_NS), NOW_NS)
    known = controller.known
    assert at_time(known, NOW_NS) == known
    after = at_time(known, NOW_NS - 1)
    assert (after.known, after.sent.length, after.trend.known) == (False, 0, False)
    assert (after.status, after.follower) == (known.status, known.follower)
