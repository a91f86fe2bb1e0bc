"""The one shape of every daemon: a step over events that knows its state and no more, and what it owes a log.

A node never looks at a clock and never touches a socket. Live daemons, lockstep and replay differ only in who
calls :meth:`Node.step` and what ``now_ns`` is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar

from msgspec import Struct

from hil.wire.events import Event
from hil.wire.message_types import DiagnosticArray, DiagnosticStatus, KeyValue, Message
from hil.wire.messages import encode, header, typename_of

S = TypeVar("S")

Counts = Mapping[str, int]


class Outgoing(Struct, frozen=True):
    """A message that a node wants published; ``stamp_ns`` is the time that it speaks of."""

    topic: str
    typename: str
    payload: bytes
    stamp_ns: int


class Node(Protocol[S]):
    """A daemon without its surroundings."""

    name: str
    subscribes: tuple[str, ...]

    def begin(self, now_ns: int) -> S:
        """State at the moment the node comes up."""

    def due_ns(self, state: S) -> int:
        """When the node wants its next tick if nothing else happens before."""

    def report(self, state: S, now_ns: int) -> Outgoing:
        """Diagnostics of the node: how it is and what it has counted; also its last word."""

    def step(self, state: S, event: Event, now_ns: int) -> tuple[S, tuple[Outgoing, ...]]:
        """State after an event, which may be the same one changed, and what to publish.

        Never raises for anything that came from the wire.
        """


def outgoing(topic: str, message: Message, stamp_ns: int) -> Outgoing:
    """Encode a message for publication."""
    return Outgoing(topic, typename_of(message), encode(message), stamp_ns)


def is_due(due_ns: int, period_ns: int, now_ns: int) -> bool:
    """Whether what is to happen every period is due; also if it is so far off that the clock was set back."""
    return not now_ns < due_ns <= now_ns + period_ns


def no_counts() -> Counts:
    """Counts of nothing."""
    return {}


def counted(counts: Counts, cause: str) -> Counts:
    """Counts with one more of a cause."""
    return {**counts, cause: counts.get(cause, 0) + 1}


LAW_FAILURE = "law.failure"
"""Value of a controller's diagnostics that says why a law of one's own failed."""


def named_counts(group: str, counts: Counts) -> dict[str, object]:
    """Counts as values of a diagnostics message, each key ``group.cause``."""
    return {f"{group}.{cause}": count for cause, count in counts.items()}


def diagnostics(name: str, now_ns: int, problem: str, values: Mapping[str, object]) -> DiagnosticArray:
    """One node's state as ROS diagnostics: OK without a problem, else WARN with the problem as message."""
    status = DiagnosticStatus(
        level=1 if problem else 0,
        name=f"abreast/{name}",
        message=problem or "ok",
        hardware_id="",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(now_ns, ""), status=[status])
