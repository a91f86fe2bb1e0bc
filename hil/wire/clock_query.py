"""The time of another session's host, asked for over the wire: how far its clock is ahead of ours."""

from __future__ import annotations

import struct
import time

import zenoh

CLOCKS = "abreast/clock"
"""What the keys begin with at which sessions tell the time; their ids follow."""

_LONGEST_WAY_S = 0.1
_PATIENCE_S = 0.5
_NS = 1e-9


def tell_time(session: zenoh.Session) -> zenoh.Queryable[None]:
    """Let others ask this session for its host's time, nanoseconds since 1970."""
    key = f"{CLOCKS}/{session.zid()}"

    def answer(query: zenoh.Query) -> None:
        query.reply(key, struct.pack("<q", time.time_ns()))

    return session.declare_queryable(key, zenoh.handlers.Callback(answer, indirect=False))


def ahead_of_us(asked_ns: int, told_ns: int, heard_ns: int) -> tuple[float, float]:
    """By how much [s] a clock is ahead, and by how much this may be wrong: half the way there and back.

    >>> ahead_of_us(0, 60_000_000, 20_000_000)
    (0.05, 0.01)
    """
    way_ns = heard_ns - asked_ns
    return (told_ns - asked_ns - 0.5 * way_ns) * _NS, 0.5 * way_ns * _NS


class ClockQuery:
    """Asks one session after the other for the time. ``heard``: whether the last answer is of use."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._whom = ""
        self.heard, self.seen_s, self._surely_s = False, 0.0, 0.0

    def ask(self, whom: str) -> None:
        """Ask a session; what it answers is there the next time. Who is not to be asked is not asked."""
        if whom != self._whom:
            self._whom, self.heard = whom, False
        asked_ns, began_s = time.time_ns(), time.monotonic()

        def hear(reply: zenoh.Reply) -> None:
            payload = reply.ok.payload.to_bytes() if reply.ok is not None else b""
            way_s = time.monotonic() - began_s
            if len(payload) != 8 or way_s > _LONGEST_WAY_S or whom != self._whom:
                return
            told_ns: int = struct.unpack("<q", payload)[0]
            seen_s, error_s = ahead_of_us(asked_ns, told_ns, asked_ns + round(way_s * 1e9))
            self.seen_s = seen_s
            self._surely_s = max(0.0, abs(seen_s) - error_s) * (1.0 if seen_s > 0.0 else -1.0)
            self.heard = True

        self._session.get(
            f"{CLOCKS}/{whom}", zenoh.handlers.Callback(hear, indirect=False), timeout=_PATIENCE_S
        )

    def ahead_s(self, whom: str) -> float | None:
        """By how much a session's clock is ahead at the least [s]; None where that is not known."""
        return self._surely_s if self.heard and whom == self._whom else None
