"""The rows of a window: made, moved up, and made longer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from formation.lending import lent
from formation.records import R, Rows, columns_of, load, row_of, rows_of, store
from hil.replay.window import NOT_WANTED, UNKNOWN_CHANNEL, Extent, Logged, Number, Topic, Window
from hil.wire.blake2b import BLOCK_BYTES

_CHANNELS = 1 << 16
_ARENA_BYTES = 1 << 22
_MESSAGES = 1 << 14


class WindowRows:
    """Rows of a window over these topics, in whose order they are numbered.

    ``hashed``: those that receipts name. ``aside``: those that Python wants to see. ``channels``: topics by
    channel id.
    """

    def __init__(
        self,
        topics: Sequence[str],
        hashed: Collection[str],
        aside: Collection[str],
        channels: Mapping[int, str],
    ) -> None:
        self.topics = tuple(topics)
        numbers = {topic: number for number, topic in enumerate(topics)}
        names = [topic.encode() + b"\0" if topic in hashed else b"" for topic in topics]
        begins = np.cumsum([0, *map(len, names)]).tolist()
        self._topics = rows_of(Topic, len(topics))
        for number, topic in enumerate(topics):
            row = Topic(begins[number], len(names[number]), topic in hashed, topic in aside)
            store(self._topics, number, row)
        self._names = np.frombuffer(b"".join(names) + b"\0", dtype=np.uint8)
        self._channels = rows_of(Number, _CHANNELS)
        columns_of(self._channels)["value"] = UNKNOWN_CHANNEL
        for channel, topic in channels.items():
            store(self._channels, channel, Number(numbers.get(topic, NOT_WANTED)))
        self.extent = row_of(Extent(_ARENA_BYTES - BLOCK_BYTES, 0, 0, 0, 0, False))
        self._arena = np.zeros(_ARENA_BYTES, dtype=np.uint8)
        self.logged = rows_of(Logged, _MESSAGES)
        self._slots = rows_of(Number, 4 * _MESSAGES)
        self._asides = rows_of(Number, _MESSAGES)
        self._lend()

    def _lend(self) -> None:
        self.record = Window(
            self._arena,
            self.logged,
            self._slots,
            self.extent,
            self._topics,
            self._names,
            self._channels,
            self._asides,
        )
        self.lent: Rows[Window] = lent(self.record)

    @property
    def room(self) -> int:
        """For how many messages there is room."""
        return len(columns_of(self.logged))

    @property
    def size(self) -> int:
        """How many bytes there is room for."""
        return len(self._arena)

    def is_half_free(self, first: int) -> bool:
        """Whether half of the room is free once all before a message are gone."""
        extent = load(Extent, self.extent, 0)
        kept = extent.messages - first
        begin = int(columns_of(self.logged)["at"][first]) if kept else extent.filled
        return 2 * kept <= self.room and 2 * (extent.filled - begin) <= extent.room

    def grow(self) -> None:
        """Make room for twice as much."""
        extent, n = load(Extent, self.extent, 0), self.room
        self._arena = np.concatenate([self._arena, np.zeros_like(self._arena)])
        self.logged, self._slots = _doubled(self.logged), rows_of(Number, 8 * n)
        self._asides = _doubled(self._asides)
        store(self.extent, 0, extent._replace(room=len(self._arena) - BLOCK_BYTES))
        self._lend()

    def asides(self) -> list[tuple[str, int, bytes]]:
        """Topic, log time and payload of what Python wants to see and has not seen yet."""
        extent = load(Extent, self.extent, 0)
        seen: list[tuple[str, int, bytes]] = []
        for place in columns_of(self._asides)["value"][: extent.asides].tolist():
            log_ns, at, length, topic, _ = columns_of(self.logged)[place].item()
            seen.append((self.topics[topic], log_ns, self._arena[at : at + length].tobytes()))
        store(self.extent, 0, extent._replace(asides=0))
        return seen

    def log_times(self) -> NDArray[np.int64]:
        """Log times of the messages that are in their place."""
        admitted = load(Extent, self.extent, 0).admitted
        times: NDArray[np.int64] = columns_of(self.logged)["log_ns"][:admitted]
        return times

    def digests(self) -> NDArray[np.int64]:
        """Their digests, 0 for topics that receipts do not name."""
        admitted = load(Extent, self.extent, 0).admitted
        found: NDArray[np.int64] = columns_of(self.logged)["digest"][:admitted]
        return found


def _doubled(rows: Rows[R]) -> Rows[R]:
    held = columns_of(rows)
    return cast("Rows[R]", np.concatenate([held, np.zeros_like(held)]))
