"""The source node: motion capture in whatever messages a lab has it, made into our mocap frames.

It is hosted by whoever hosts the first follower's estimator, or by nobody where frames come as ours.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from hil.nodes.findings import named_findings
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, is_due, named_counts, no_counts, outgoing
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, header
from hil.wire.pose_sources import NamedPlace, places_in, pose_of, upright
from hil.wire.source_topics import lab_bodies, source_topics

NAME = "source"
_TICK_NS = 100_000_000
_DIAGNOSTICS_NS = 500_000_000
_MOST_STRANGERS = 20
_GONE_NS = 1_000_000_000
_IN_PARTS = ("TransformStamped", "TFMessage")
"""Types of which several messages on one topic may tell of one moment."""


class Gathering(NamedTuple):
    """Poses of one moment. ``at_ns``: of the first; ``ready``: it is to be a frame."""

    at_ns: int
    places: tuple[NamedPlace, ...] = ()


@dataclass(slots=True, eq=False)
class SourceState:
    """What the node remembers.

    ``gathering``: poses that wait for those of the other bodies. ``seen_ns``: when each body was heard of
    last; ``strangers``: names of others. ``frame_ids``: of bodies whose frames of reference differ.
    """

    gathering: Gathering | None = None
    number: int = 0
    seen_ns: dict[str, int] = field(default_factory=dict)
    strangers: set[str] = field(default_factory=set)
    frame_ids: dict[str, str] = field(default_factory=dict)
    taken: Counts = field(default_factory=no_counts)
    refused: Counts = field(default_factory=no_counts)
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0


class SourceNode:
    """Step of the source of a scenario's mocap frames.

    A frame is made of what one message tells of the robots, or of the poses of all bodies that are at most
    ``source.pair_within_s`` apart, with the stamp of the first. It goes out once it is whole, or once a pose
    of the next moment comes.
    """

    name = NAME

    def __init__(self, scenario: Scenario, frames: str = topics.RIGID_BODIES) -> None:
        self._given, self._frames = scenario.source, frames
        self._within_ns = round(scenario.source.pair_within_s * 1e9)
        self._bodies = frozenset(lab_bodies(scenario))
        self._topics = source_topics(scenario)
        self.subscribes = tuple(self._topics)

    def begin(self, now_ns: int) -> SourceState:
        """State of a source of which nothing was heard."""
        return SourceState(next_tick_ns=now_ns, next_diagnostics_ns=now_ns)

    def due_ns(self, state: SourceState) -> int:
        """Time of the next tick."""
        return state.next_tick_ns

    def step(self, state: SourceState, event: Event, now_ns: int) -> tuple[SourceState, tuple[Outgoing, ...]]:
        """Take in poses; what is complete becomes a frame."""
        if event.topic:
            return state, tuple(self._heard(state, event, now_ns))
        state.next_tick_ns = now_ns + _TICK_NS
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, ()
        state.next_diagnostics_ns = now_ns + _DIAGNOSTICS_NS
        return state, (self.report(state, now_ns),)

    def report(self, state: SourceState, now_ns: int) -> Outgoing:
        """Diagnostics: bodies seen and missed, and what was refused."""
        missing = sorted(
            body for body in self._bodies if now_ns - state.seen_ns.get(body, -_GONE_NS) >= _GONE_NS
        )
        values: dict[str, object] = {"bodies": ", ".join(sorted(state.seen_ns))}
        if state.strangers:
            values["others"] = ", ".join(sorted(state.strangers))
        values |= named_counts("taken", state.taken) | named_counts("refused", state.refused)
        if text := self.differing(state):
            values |= named_findings({"frames_of_reference": text})
        problem = self._missed(state, missing) if missing else ""
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)

    def differing(self, state: SourceState) -> str:
        """That bodies are told in different frames of reference, empty if they are not."""
        told = ", ".join(f"{body!r} in {frame!r}" for body, frame in state.frame_ids.items())
        return f"bodies are told in different frames of reference: {told}; expected one" if told else ""

    def _missed(self, state: SourceState, missing: list[str]) -> str:
        names = ", ".join(map(repr, missing))
        where = ", ".join(each.name for each in self._topics.values())
        others = ", ".join(map(repr, sorted(state.strangers))) or "none"
        return f"waiting for bodies {names} on {where} (others seen: {others})"

    def _heard(self, state: SourceState, event: Event, now_ns: int) -> Iterable[Outgoing]:
        topic = self._topics.get(event.topic)
        if topic is None:
            return
        try:
            places = places_in(self._given.type, event.payload, topic.body)
        except MalformedPayloadError:
            state.refused = counted(state.refused, "malformed")
            return
        state.taken = counted(state.taken, "message")
        known = [each for each in places if each.body in self._bodies]
        if self._given.type not in _IN_PARTS and len({each.body for each in known}) < len(known):
            # Nobody can tell which of the two it is.
            state.refused = counted(state.refused, "duplicate_body")
            return
        state.strangers.update(
            each.body for each in places[:_MOST_STRANGERS] if each not in known and len(state.strangers) < 20
        )
        for each in known:
            state.seen_ns[each.body] = now_ns
            stamp_ns = now_ns if self._given.stamp == "receive" else each.stamp_ns or now_ns
            yield from self._gathered(state, each._replace(stamp_ns=stamp_ns))
        if known and not topic.body and state.gathering is not None and self._given.type not in _IN_PARTS:
            yield from self._frame(state)

    def _gathered(self, state: SourceState, place: NamedPlace) -> Iterable[Outgoing]:
        """Put a pose to those of its moment; frames that are complete by that."""
        waiting = state.gathering
        if waiting is not None and (
            abs(place.stamp_ns - waiting.at_ns) > self._within_ns
            or any(each.body == place.body for each in waiting.places)
        ):
            yield from self._frame(state)
            waiting = None
        waiting = waiting or Gathering(place.stamp_ns)
        state.gathering = waiting._replace(places=(*waiting.places, place))
        if len(state.gathering.places) == len(self._bodies):
            yield from self._frame(state)

    def _frame(self, state: SourceState) -> Iterable[Outgoing]:
        """The frame of what is gathered, if it is in one frame of reference."""
        gathered, state.gathering = state.gathering, None
        if gathered is None:
            return
        frame_ids = {each.body: each.frame_id for each in gathered.places}
        state.frame_ids = frame_ids if len(set(frame_ids.values())) > 1 else {}
        if state.frame_ids:
            state.refused = counted(state.refused, "frames_of_reference")
            return
        if len(gathered.places) < len(self._bodies):
            state.refused = counted(state.refused, "incomplete")
        state.taken = counted(state.taken, "frame")
        state.number += 1
        given = self._given
        bodies = [
            msg.RigidBody(each.body, [], pose_of(upright(each.place, given.up, given.scale)))
            for each in gathered.places
        ]
        head = header(gathered.at_ns, gathered.places[0].frame_id)
        frame = msg.RigidBodies(head, state.number % 2**32, bodies)
        yield outgoing(self._frames, frame, gathered.at_ns)
