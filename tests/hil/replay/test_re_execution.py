from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.log.events import Recorded
from hil.nodes.node import Outgoing
from hil.replay.re_execution import Execution, execute, index_by_digest, parity_of, re_execute
from hil.wire.events import Event

PERIOD_NS = 50


@dataclass(frozen=True)
class TallyState:
    total: int = 0
    receipts: tuple[tuple[int, int], ...] = ()
    next_tick_ns: int = 0


class TallyNode:
    """Adds up bytes: publishes on some, takes others in silently, publishes odd totals at a tick."""

    name = "tally"
    subscribes: tuple[str, ...] = ("in",)

    def begin(self, now_ns: int) -> TallyState:
        return TallyState(next_tick_ns=now_ns)

    def due_ns(self, state: TallyState) -> int:
        return state.next_tick_ns

    def report(self, state: TallyState, now_ns: int) -> Outgoing:
        return Outgoing("diagnostics", "", b"", now_ns)

    def step(self, state: TallyState, event: Event, now_ns: int) -> tuple[TallyState, tuple[Outgoing, ...]]:
        if not event.topic:
            state = replace(state, next_tick_ns=now_ns + PERIOD_NS)
            return self._publish(state, now_ns) if state.total % 2 else (state, ())
        receipt = (event.digest, now_ns)
        state = replace(state, receipts=(*state.receipts, receipt), total=state.total + event.payload[0])
        return (state, ()) if event.payload[0] % 3 == 0 else self._publish(state, now_ns)

    def _publish(self, state: TallyState, now_ns: int) -> tuple[TallyState, tuple[Outgoing, ...]]:
        payload = json.dumps([now_ns, state.total, state.receipts]).encode()
        out = (
            Outgoing("drive", "", bytes([state.total % 256]), now_ns),
            Outgoing("out", "", payload, now_ns),
        )
        return replace(state, receipts=()), out


def recorded(execution: Execution[TallyState]) -> list[Recorded]:
    outputs = []
    for message in execution.outputs:
        if message.topic == "out":
            now_ns, _, receipts = json.loads(message.payload)
            outputs.append(Recorded(message.payload, now_ns, tuple((name, at) for name, at in receipts)))
    return outputs


def logged_drive(execution: Execution[TallyState]) -> list[bytes]:
    return [each.payload for each in execution.outputs if each.topic == "drive"]


logged_steps = st.lists(st.tuples(st.integers(0, 255), st.integers(0, 120)), min_size=1, max_size=40)


def live(steps: list[tuple[int, int]]) -> tuple[list[tuple[Event, int]], Execution[TallyState]]:
    """A life in which every input is another payload, at times that now and then are equal."""
    now_ns, events = 1000, []
    for number, (value, gap) in enumerate(steps):
        now_ns += gap
        events.append((Event("in", bytes([value, number])), now_ns))
    return events, execute(TallyNode(), events)


@given(logged_steps)
def test_a_life_with_ticks_and_silent_inputs_is_repeated_bit_for_bit(steps: list[tuple[int, int]]) -> None:
    events, execution = live(steps)
    again = re_execute(TallyNode(), "out", recorded(execution), index_by_digest(events))
    parity = parity_of(again.repeated, "out", {"drive": logged_drive(execution)})
    assert (parity.mismatched, parity.first, again.missing) == (0, None, 0)
    assert parity.compared == len(recorded(execution))
    assert again.outputs == execution.outputs


@given(logged_steps, logged_steps)
def test_a_node_that_was_started_again_is_repeated_all_the_same(
    before: list[tuple[int, int]], after: list[tuple[int, int]]
) -> None:
    events, first = live(before)
    later = [(Event("in", event.payload + b"!"), now_ns + 10**6) for event, now_ns in live(after)[0]]
    second = execute(TallyNode(), later)
    outputs = recorded(first) + recorded(second)
    again = re_execute(TallyNode(), "out", outputs, index_by_digest([*events, *later]))
    parity = parity_of(again.repeated, "out", {"drive": logged_drive(first) + logged_drive(second)})
    assert (parity.compared, parity.mismatched, again.missing) == (len(outputs), 0, 0)
    assert again.restarts == (len(recorded(first)) > 0 and len(recorded(second)) > 0)


@given(logged_steps, st.data())
def test_an_input_that_the_log_lacks_is_counted_and_shows_as_a_mismatch(
    steps: list[tuple[int, int]], data: st.DataObject
) -> None:
    events, execution = live(steps)
    outputs = recorded(execution)
    consumed = {name for output in outputs for name, _ in output.consumed}
    index = index_by_digest(events)
    if not consumed:
        return
    lost = data.draw(st.sampled_from(sorted(consumed)))
    del index[lost]
    again = re_execute(TallyNode(), "out", outputs, index)
    parity = parity_of(again.repeated, "out", {})
    place = next(n for n, output in enumerate(outputs) if lost in {name for name, _ in output.consumed})
    assert again.missing == 1
    assert parity.first == place


@given(logged_steps, st.data())
def test_a_flipped_bit_in_an_output_is_found_there_and_only_there(
    steps: list[tuple[int, int]], data: st.DataObject
) -> None:
    events, execution = live(steps)
    outputs = recorded(execution)
    if not outputs:
        return
    place = data.draw(st.integers(0, len(outputs) - 1))
    bit = data.draw(st.integers(0, 8 * len(outputs[place].payload) - 1))
    broken = bytearray(outputs[place].payload)
    broken[bit // 8] ^= 1 << bit % 8
    outputs[place] = replace(outputs[place], payload=bytes(broken))
    parity = parity_of(re_execute(TallyNode(), "out", outputs, index_by_digest(events)).repeated, "out", {})
    assert (parity.mismatched, parity.first) == (1, place)


ROUTE = [(2, 0), (4, 1), (10, 1), (0, 1), (8, 1)]
OTHERS = b"other"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda sent: sent, (0, None, 0)),
        (lambda sent: [*sent[:2], OTHERS, *sent[3:]], (1, 2, 0)),
        (lambda sent: [OTHERS, *sent[1:-1], OTHERS], (2, 0, 0)),
        (lambda sent: [*sent[:2], *sent[3:]], (0, None, 1)),
        (lambda sent: sent[:-1], (0, None, 1)),
        (lambda sent: [OTHERS, *sent[:2], OTHERS, *sent[2:], OTHERS], (0, None, 0)),
        (lambda sent: [], (0, None, 4)),
    ],
    ids=["same", "changed", "two changed", "missed", "cut", "sent by others", "not recorded"],
)
def test_beside_the_output_a_changed_message_differs_and_a_missed_one_cannot_be_compared(
    change: Callable[[list[bytes]], list[bytes]], expected: tuple[int, int | None, int]
) -> None:
    events, execution = live(ROUTE)
    sent = logged_drive(execution)
    assert len(sent) == 4
    again = re_execute(TallyNode(), "out", recorded(execution), index_by_digest(events))
    parity = parity_of(again.repeated, "out", {"drive": change(sent)})
    assert (parity.mismatched, parity.first, parity.unrecorded) == expected


@given(logged_steps, st.data())
def test_messages_that_repeat_may_be_missed_without_a_difference(
    steps: list[tuple[int, int]], data: st.DataObject
) -> None:
    """Payloads of a robot that stands are all the same; missing some shifts the others, no more."""
    events, execution = live([(value % 2, gap) for value, gap in steps])
    sent = logged_drive(execution)
    kept = data.draw(st.lists(st.booleans(), min_size=len(sent), max_size=len(sent)))
    logged = [name for name, keep in zip(sent, kept, strict=True) if keep]
    again = re_execute(TallyNode(), "out", recorded(execution), index_by_digest(events))
    parity = parity_of(again.repeated, "out", {"drive": logged})
    assert parity.mismatched == 0
    assert parity.unrecorded >= len(sent) - len(logged)


def test_an_output_that_cannot_be_read_is_a_mismatch_and_no_step() -> None:
    execution = re_execute(TallyNode(), "out", [Recorded(b"\0", None)], {})
    assert parity_of(execution.repeated, "out", {}).mismatched == 1
    assert execution.outputs == ()


def test_ticks_fall_due_between_the_events_and_never_at_an_event() -> None:
    _, execution = live([(1, 0), (0, 120), (0, 30)])
    assert [each.stamp_ns for each in execution.outputs if each.topic == "out"] == [1000, 1000, 1050, 1100]


def test_a_life_without_events_ends_where_it_begins() -> None:
    node = TallyNode()
    assert execute(node, []) == Execution(node.begin(0), ())
    assert re_execute(node, "out", [], {}).state == node.begin(0)
