"""The emulated motion capture in the messages, axes and unit that a scenario's ``[source]`` names."""

from __future__ import annotations

from hil.nodes.node import Outgoing, diagnostics, outgoing
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as, header
from hil.wire.pose_sources import OF_ONE, laid, message_of, places_of
from hil.wire.source_topics import source_topics

_NEVER_NS = 2**62


class ForeignMocapNode:
    """Step of what tells our frames as the lab's own motion capture would; it remembers nothing."""

    name = "foreign_mocap"

    def __init__(self, scenario: Scenario) -> None:
        self._given = scenario.source
        self._topics = source_topics(scenario)
        self.subscribes: tuple[str, ...] = (topics.RIGID_BODIES,)

    def begin(self, now_ns: int) -> None:
        """There is nothing to begin with."""

    def due_ns(self, state: None) -> int:
        """It is never due."""
        return _NEVER_NS

    def step(self, state: None, event: Event, now_ns: int) -> tuple[None, tuple[Outgoing, ...]]:
        """Tell a frame in other messages, one for each topic."""
        if event.topic != topics.RIGID_BODIES:
            return None, ()
        try:
            frame = decode_as(event.payload, msg.RigidBodies)
        except MalformedPayloadError:
            return None, ()
        given = self._given
        places = places_of(frame)
        bodies = [(each.body, laid(each.place, given.up, given.scale)) for each in places]
        stamp_ns = places[0].stamp_ns if places else now_ns
        head = header(0 if given.stamp == "receive" else stamp_ns, frame.header.frame_id)
        told = []
        for topic, where in self._topics.items():
            its = [(body, place) for body, place in bodies if where.body in ("", body)]
            messages = [[each] for each in its] if given.type in OF_ONE else [its]
            told += [outgoing(topic, message_of(given.type, head, each), stamp_ns) for each in messages]
        return None, tuple(told)

    def report(self, state: None, now_ns: int) -> Outgoing:
        """Diagnostics: it is well."""
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, "", {}), now_ns)
