"""Re-execution: logged inputs put through a node again, step by step, to see whether the same comes out.

Every estimate and every command lists what its node had taken in since the one before, by digest, with the
``now`` of each step. That, and the payloads themselves, is enough to execute the node again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from hil.log.events import Recorded, Timed
from hil.nodes.node import Node, Outgoing, is_due
from hil.wire.events import TICK, Event

S = TypeVar("S")
P = TypeVar("P", bound=Hashable)
_REPORTS_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class Repeated:
    """What a node put out where an output had been recorded, and how many of its inputs are missing."""

    recorded: Recorded
    outputs: tuple[Outgoing, ...]
    missing: int


@dataclass(frozen=True, slots=True)
class Parity:
    """How many outputs were compared, how many differ in any bit, and the place of the first that does.

    ``unrecorded``: messages that went out beside them and are not in the log: nobody can compare them.
    ``gap_s``: for how long before the first that differs no output was recorded.
    """

    compared: int
    mismatched: int
    first: int | None = None
    unrecorded: int = 0
    gap_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Execution(Generic[S]):
    """Execution of a node: the state it ended in, and all its outputs.

    ``repeated``: the outputs by what they repeat, empty unless it is a re-execution. ``restarts``: how often
    it was started again. ``reports``: diagnostics of the node, every so often and at the end.
    """

    state: S
    outputs: tuple[Outgoing, ...]
    repeated: tuple[Repeated, ...] = ()
    restarts: int = 0
    reports: tuple[Outgoing, ...] = ()

    @property
    def missing(self) -> int:
        """How many consumed inputs the log does not have."""
        return sum(step.missing for step in self.repeated)


def index_by_digest(events: Iterable[Timed]) -> dict[int, Event]:
    """Events by what receipts call them."""
    return {event.digest: event for event, _ in events}


def re_execute(
    node: Node[S],
    topic: str,
    recorded: Sequence[Recorded],
    index: Mapping[int, Event],
    *,
    same_node: bool = True,
) -> Execution[S]:
    """Execute a node again from the outputs that it left on a topic.

    An output that none of its inputs brings forth came from a tick at the time it was computed. Inputs that
    are missing in the index are passed over and counted; what was consumed after the last output, nobody can
    know. Where the ``same_node`` as live does not repeat an output, and one that has just begun does, it had
    been started again.
    """
    state = node.begin(_first_ns(recorded))
    repeated: list[Repeated] = []
    reports = _Reports(node)
    restarts = 0
    for number, output in enumerate(recorded):
        after, step = _repeat(node, topic, state, output, index)
        if same_node and number and not _agrees(step, topic):
            begun = node.begin(_first_ns([output]))
            anew, again = _repeat(node, topic, begun, output, index)
            if _agrees(again, topic):
                after, step, restarts = anew, again, restarts + 1
        state = after
        repeated.append(step)
        reports.hear(state, output.computed_ns)
    outputs = tuple(message for step in repeated for message in step.outputs)
    return Execution(state, outputs, tuple(repeated), restarts, reports.all(state))


def _repeat(
    node: Node[S], topic: str, state: S, output: Recorded, index: Mapping[int, Event]
) -> tuple[S, Repeated]:
    out: list[Outgoing] = []
    missing = 0
    for name, now_ns in output.consumed:
        event = index.get(name)
        if event is None:
            missing += 1
            continue
        state, sent = node.step(state, event, now_ns)
        out.extend(sent)
    if output.computed_ns is not None and not any(message.topic == topic for message in out):
        state, sent = node.step(state, TICK, output.computed_ns)
        out.extend(sent)
    return state, Repeated(output, tuple(out), missing)


def execute(node: Node[S], events: Iterable[Timed]) -> Execution[S]:
    """Execute a node on events in their order, with its own ticks where they fall due in between."""
    outputs: list[Outgoing] = []
    state: S | None = None
    reports = _Reports(node)
    for event, now_ns in events:
        if state is None:
            state = node.begin(now_ns)
        while (due_ns := node.due_ns(state)) < now_ns:
            state, sent = node.step(state, TICK, due_ns)
            outputs.extend(sent)
        state, sent = node.step(state, event, now_ns)
        outputs.extend(sent)
        reports.hear(state, now_ns)
    begun = node.begin(0) if state is None else state
    return Execution(begun, tuple(outputs), reports=reports.all(begun))


class _Reports(Generic[S]):
    """What a node reports while it is executed: its own ticks may not be among what is repeated."""

    def __init__(self, node: Node[S]) -> None:
        self._node = node
        self._reports: list[Outgoing] = []
        self._next_ns = 0
        self._now_ns: int | None = None

    def hear(self, state: S, now_ns: int | None) -> None:
        """Ask for a report if one is due; nothing without a time."""
        if now_ns is None:
            return
        self._now_ns = now_ns
        if is_due(self._next_ns, _REPORTS_NS, now_ns):
            self._reports.append(self._node.report(state, now_ns))
            self._next_ns = now_ns + _REPORTS_NS

    def all(self, state: S) -> tuple[Outgoing, ...]:
        """All reports, the last one included; none of a node that nothing was heard of."""
        if self._now_ns is None:
            return ()
        return (*self._reports, self._node.report(state, self._now_ns))


def parity_of(repeated: Sequence[Repeated], topic: str, beside: Mapping[str, Sequence[bytes]]) -> Parity:
    """Compare repeated outputs with the recorded ones, bit for bit.

    An output agrees if the node put out just that one payload on the topic. ``beside``: payloads as
    logged, in order, on topics that the node sends to as well; an output also differs if the log has
    something else in the place of what went there. What the recorder missed there is only counted.
    """
    wrong = {place for place, step in enumerate(repeated) if not _agrees(step, topic)}
    unrecorded = 0
    for name, logged in beside.items():
        sent = [(payload, place) for place, step in enumerate(repeated) for payload in _payloads(step, name)]
        differing, missed = compare_in_order(sent, logged)
        wrong |= differing
        unrecorded += missed
    first = min(wrong, default=None)
    return Parity(len(repeated), len(wrong), first, unrecorded, _gap_before(repeated, first))


def parity_beside(outputs: Iterable[Outgoing], topic: str, logged: Sequence[bytes]) -> Parity:
    """Compare what was logged on a topic that a node sends to beside its outputs, bit for bit.

    A logged payload agrees if the node put it out too, as often as it is logged. What is logged after all
    that can be repeated does not count: the node went on after its last recorded output.
    """
    unmatched = Counter(message.payload for message in outputs if message.topic == topic)
    sent, wrong, agreed = unmatched.total(), [], 0
    for place, payload in enumerate(logged):
        if unmatched[payload]:
            unmatched[payload] -= 1
            agreed = place + 1
        else:
            wrong.append(place)
    compared = min(len(logged), agreed + unmatched.total())
    wrong = [place for place in wrong if place < compared]
    return Parity(compared, len(wrong), min(wrong, default=None), max(0, sent - compared))


def compare_in_order(sent: Sequence[tuple[P, int]], logged: Sequence[P]) -> tuple[set[int], int]:
    """Places of what was sent and is logged as something else, and how much is not logged at all.

    ``sent``: payloads, or what stands for them, each with its place.

    Both are walked in step. What one has and the other does not is passed over: the recorder can miss a
    message, and others can send on the topic. Only where both happen at once, one was put for the other.
    """
    to_send, to_come = Counter(payload for payload, _ in sent), Counter(logged)
    differing: set[int] = set()
    missed = 0
    at = 0
    for payload, place in sent:
        lost = to_come[payload] == 0
        while at < len(logged) and logged[at] != payload and to_send[logged[at]] == 0:
            to_come[logged[at]] -= 1
            at += 1
            if lost:
                differing.add(place)
                break
        to_send[payload] -= 1
        if at < len(logged) and logged[at] == payload:
            to_come[payload] -= 1
            at += 1
        elif place not in differing:
            missed += 1
    return differing, missed


def _gap_before(repeated: Sequence[Repeated], place: int | None) -> float:
    if not place:
        return 0.0
    before, after = (step.recorded.computed_ns for step in repeated[place - 1 : place + 1])
    return 0.0 if before is None or after is None else (after - before) * 1e-9


def _agrees(step: Repeated, topic: str) -> bool:
    return _payloads(step, topic) == [step.recorded.payload]


def _payloads(step: Repeated, topic: str) -> list[bytes]:
    return [message.payload for message in step.outputs if message.topic == topic]


def _first_ns(recorded: Sequence[Recorded]) -> int:
    """When the node first did anything that is known of."""
    for output in recorded:
        if output.consumed:
            return output.consumed[0][1]
        if output.computed_ns is not None:
            return output.computed_ns
    return 0
