"""One sender for each topic: whom a daemon listens to, and who else speaks there."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.byte_stamp import stamp_ns
from hil.wire.events import Event
from hil.wire.outlet import sender_of
from hil.wire.source_topics import source_topics
from hil.wire.topics import link_topics

GONE_NS = 1_000_000_000
"""A sender that has been silent for so long may be replaced by another one."""

_SAID_NS = 2_000_000_000
_WINDOW_NS = 1_000_000_000
_BACKWARDS = 3
"""So many stamps that run back within a second tell of two senders that say nothing of themselves."""


@dataclass(slots=True)
class _OfTopic:
    """Who is listened to on a topic; ``other`` spoke there as well, last at a time."""

    sender: str
    name: str
    heard_ns: int
    other: str = ""
    other_ns: int = 0
    stamp_ns: int = 0
    backwards_ns: list[int] = field(default_factory=list)


class SenderWatch:
    """Keeps to the first sender of each of some topics until it falls silent, and names who else sends.

    Senders are told apart by their sessions; of those without one, by stamps that run back and forth. Times
    are of a clock that is never set [ns].
    """

    def __init__(self, watched: Collection[str]) -> None:
        self._watched = frozenset(watched)
        self._topics: dict[str, _OfTopic] = {}
        self.refused: dict[str, int] = {}

    def admits(self, event: Event, now_ns: int) -> bool:
        """Whether an arrival is of the one who is listened to."""
        if event.topic not in self._watched:
            return True
        origin = event.origin
        sender = origin.sender if origin is not None else ""
        known = self._topics.get(event.topic)
        if known is None or (known.sender != sender and now_ns - known.heard_ns > GONE_NS):
            known = self._topics[event.topic] = _OfTopic(sender, sender_of(origin), now_ns)
        if known.sender != sender:
            known.other, known.other_ns = sender_of(origin), now_ns
            self.refused[event.topic] = self.refused.get(event.topic, 0) + 1
            return False
        known.heard_ns = now_ns
        if origin is None:
            self._look_at_stamps(known, stamp_ns(event.payload), now_ns)
        return True

    def second_senders(self, now_ns: int) -> list[str]:
        """In words, on which topics somebody else has sent of late."""
        said = []
        for topic, known in self._topics.items():
            if known.other and now_ns - known.other_ns <= _SAID_NS:
                said.append(f"{known.other} sends {topic} as well as {known.name}, who is listened to")
            elif len([at for at in known.backwards_ns if now_ns - at <= _SAID_NS]) >= _BACKWARDS:
                said.append(f"stamps on {topic} run back and forth, as of two senders without sessions")
        return said

    def _look_at_stamps(self, known: _OfTopic, stamp: int, now_ns: int) -> None:
        if 0 < stamp < known.stamp_ns:
            known.backwards_ns = [at for at in known.backwards_ns if now_ns - at <= _WINDOW_NS] + [now_ns]
        known.stamp_ns = stamp


def single_topics(scenario: Scenario) -> frozenset[str]:
    """Topics of a scenario that have one sender each, but for those that guards look after."""
    pairs = [link_topics(link) for link in links_of(scenario)]
    single = {topics.RIGID_BODIES, pairs[0].leader_odom}
    for pair in pairs:
        single |= {pair.odom, pair.sighting, pair.estimate, pair.certified, pair.command, pair.truth}
    # Transforms, and poses that share a topic, may come of several.
    return frozenset(single | {topic for topic, each in source_topics(scenario).items() if each.body})
