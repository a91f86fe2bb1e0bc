"""How much a daemon takes in: so many messages a second of each topic and sender, and no more.

A flood is cut off before anything is decoded or queued, so that what comes beside it is not kept waiting.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hil.scenario.schema import Scenario
from hil.wire.events import Event
from hil.wire.source_topics import lab_bodies, source_topics

MOST_HZ = 1000.0
"""Messages a second that one sender gets through on one topic: no lab's robot or mocap sends more."""

_BURST_S = 0.5  # what a link that hung for a moment delivers at once
_PIECE = 32_768  # bytes that count as one message
_SENDERS = 8  # by name on each topic; all others count as one
_OTHERS = ""
_GONE_NS = 1_000_000_000  # a sender that was silent for so long may begin anew under any name
_NS = 1e-9


@dataclass(slots=True)
class _Bucket:
    """Messages that may still come at once, as of a time."""

    left: float
    at_ns: int

    def takes(self, cost: float, rate_hz: float, now_ns: int) -> bool:
        """Whether there is room for a message, which is then taken up."""
        refilled = self.left + max(0, now_ns - self.at_ns) * _NS * rate_hz
        self.left, self.at_ns = min(refilled, rate_hz * _BURST_S), max(now_ns, self.at_ns)
        # One that is larger than all that may come at once gets through when nothing else does.
        if self.left < min(cost, rate_hz * _BURST_S):
            return False
        self.left -= cost
        return True


@dataclass(slots=True)
class _OfTopic:
    """What came on a topic: in all and too much, since a look and ever."""

    buckets: dict[str, _Bucket] = field(default_factory=dict)
    arrived: int = 0
    surplus: int = 0
    refused: int = 0

    def bucket(self, sender: str, rate_hz: float, now_ns: int) -> _Bucket:
        """The bucket of a sender."""
        known = self.buckets.get(sender)
        if known is not None:
            return known
        if len(self.buckets) >= _SENDERS:
            kept = {who: each for who, each in self.buckets.items() if now_ns - each.at_ns <= _GONE_NS}
            self.buckets = kept
            if len(kept) >= _SENDERS:
                sender = _OTHERS
        return self.buckets.setdefault(sender, _Bucket(rate_hz * _BURST_S, now_ns))


@dataclass(slots=True)
class Intake:
    """Lets in what comes at a sane rate, by topic and sender, and counts the rest.

    ``rates``: topics on which more than :data:`MOST_HZ` is sane. Times are of a clock that is never set [ns].
    Called by one thread at a time.
    """

    rates: Mapping[str, float] = field(default_factory=dict)
    _topics: dict[str, _OfTopic] = field(default_factory=dict)
    _looked_ns: int | None = None

    def takes(self, event: Event, now_ns: int) -> bool:
        """Whether an arrival is let in."""
        of_topic = self._topics.get(event.topic)
        if of_topic is None:
            of_topic = self._topics.setdefault(event.topic, _OfTopic())
        if self._looked_ns is None:
            self._looked_ns = now_ns
        rate_hz = self.rates.get(event.topic, MOST_HZ)
        of_topic.arrived += 1
        sender = event.origin.sender if event.origin is not None else _OTHERS
        cost = max(1.0, len(event.payload) / _PIECE)
        if of_topic.bucket(sender, rate_hz, now_ns).takes(cost, rate_hz, now_ns):
            return True
        of_topic.surplus += 1
        of_topic.refused += 1
        return False

    def refused(self) -> dict[str, int]:
        """How many arrivals were not let in, by topic."""
        return {topic: each.refused for topic, each in self._topics.copy().items() if each.refused}

    def floods(self, now_ns: int) -> dict[str, str]:
        """By topic, how much more came since the last look than is let in; nothing where it was not more."""
        since_ns, self._looked_ns = self._looked_ns, now_ns
        seconds = 0.0 if since_ns is None else (now_ns - since_ns) * _NS
        found = {}
        for topic, each in self._topics.copy().items():
            arrived, surplus = each.arrived, each.surplus
            each.arrived = each.surplus = 0
            if surplus and seconds > 0.0:
                found[topic] = (
                    f"{arrived / seconds:.0f} messages a second on {topic}, {surplus / arrived:.0%} of them "
                    f"dropped; at most {self.rates.get(topic, MOST_HZ):.0f} a second of a sender are taken in"
                )
        return found


def intake_of(scenario: Scenario) -> Intake:
    """The intake of a scenario's lab, where the poses of several bodies may come one by one on one topic."""
    bodies = max(1, len(lab_bodies(scenario)))
    shared = (topic for topic, each in source_topics(scenario).items() if not each.body)
    return Intake(dict.fromkeys(shared, bodies * MOST_HZ))
