"""What the channels of a log that may be damaged are: whatever tells of them and can be read.

Logs tell of topics and types where they come first, again while they go on, and in their summary. Of types
that are known here the hash that stands beside a topic is enough.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator

from mcap.records import Channel, Schema

from hil.log.mcap_summary import McapSummary
from hil.wire.message_types import OWN_TYPES
from hil.wire.messages import definition, rihs01, typename_of

Declaration = Schema | Channel


class Declarations:
    """Channels and types by their numbers: as the summary has them, else as first met.

    ``elsewhere``: gives all declarations of the log; asked once, where a message needs one that is not known.
    """

    def __init__(self, summary: McapSummary, elsewhere: Callable[[], Iterable[Declaration]]) -> None:
        self._channels, self._schemas = dict(summary.channels), dict(summary.schemas)
        self._elsewhere = elsewhere
        self._looked = False

    def hear(self, record: Declaration) -> None:
        """A declaration that was met."""
        if isinstance(record, Channel):
            self._channels.setdefault(record.id, record)
        else:
            self._schemas.setdefault(record.id, record)

    def channel(self, number: int) -> Channel | None:
        """The channel of a number; None if nothing tells of it."""
        if number not in self._channels:
            self._look_elsewhere()
        return self._channels.get(number)

    def schema_of(self, channel: Channel) -> Schema | None:
        """The type of a channel; None if it has none or nothing tells of it."""
        if not channel.schema_id:
            return None
        if channel.schema_id not in self._schemas:
            self._look_elsewhere()
        return self._schemas.get(channel.schema_id) or _known(channel)

    def channels(self) -> Iterator[Channel]:
        """All channels that are known of by now, in the order of their numbers."""
        for number in sorted(self._channels):
            yield self._channels[number]

    def _look_elsewhere(self) -> None:
        if not self._looked:
            self._looked = True
            for record in self._elsewhere():
                self.hear(record)


def _known(channel: Channel) -> Schema | None:
    """A type of ours, by the hash that a channel's metadata tell."""
    name = _names_by_hash().get(channel.metadata.get("topic_type_hash", ""))
    if name is None:
        return None
    return Schema(id=channel.schema_id, name=name, encoding="ros2msg", data=definition(name).encode())


@functools.cache
def _names_by_hash() -> dict[str, str]:
    return {rihs01(typename_of(kind)): typename_of(kind) for kind in OWN_TYPES}
