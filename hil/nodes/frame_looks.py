"""Looks at mocap frames, used or refused: what tells axes, unit, clock and names that are wrong."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Literal, NamedTuple

from formation.records import load
from hil.wire import message_types as msg
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.reading import FrameReader
from hil.wire.records import Body, FrameHead, Placement, is_time, ns_of

LOOK_NS = 250_000_000
"""From one look to the next: bodies cross no room in between, and looks cost next to nothing."""

KEPT_NS = 8_000_000_000
"""How long a look counts."""

_LONGEST_NAME = 200
_FRAME_ID_AT = 12


class Look(NamedTuple):
    """A frame that came at ``at_ns``; ``stamp_ns`` is negative without a stamp that is a time.

    ``leader``, ``follower``: as the frame has them, None for one that is not in it exactly once.
    """

    at_ns: int
    stamp_ns: int
    frame_id: str
    leader: Placement | None
    follower: Placement | None

    @property
    def pair(self) -> tuple[Placement, Placement] | None:
        """Both bodies, if both are there."""
        return None if self.leader is None or self.follower is None else (self.leader, self.follower)


def look_at(reader: FrameReader, payload: bytes, leader: int, follower: int, at_ns: int) -> Look | None:
    """Look at the frame that a reader has read last, and whose payload this is; None if it is no message.

    ``leader``, ``follower``: places of their names among the reader's.
    """
    head = load(FrameHead, reader.heads, 0)
    if not head.sound:
        return None
    stamp_ns = ns_of(head.stamp) if is_time(head.stamp) else -1
    seen = [load(Body, reader.bodies, place) for place in (leader, follower)]
    first, second = (body.place if body.seen == 1 else None for body in seen)
    return Look(at_ns, stamp_ns, frame_id_in(payload), first, second)


def with_look(looks: Sequence[Look], look: Look) -> tuple[Look, ...]:
    """Looks with a newer one, without those that are too old, or later than it as a clock was set back."""
    return (*recent(looks, look.at_ns), look)


def recent(looks: Sequence[Look], now_ns: int) -> tuple[Look, ...]:
    """Looks that count at ``now_ns``."""
    return tuple(each for each in looks if now_ns - KEPT_NS < each.at_ns <= now_ns)


def frame_id_in(payload: bytes) -> str:
    """Frame of reference of a message that begins with a header, empty where there is none.

    >>> frame_id_in(bytes.fromhex("00010000 00000000 00000000 04000000 6d617000"))
    'map'
    """
    order: Literal["little", "big"] = "little" if payload[1:2] == b"\x01" else "big"
    length = int.from_bytes(payload[_FRAME_ID_AT : _FRAME_ID_AT + 4], order)
    begin = _FRAME_ID_AT + 4
    return payload[begin : begin + min(length, _LONGEST_NAME)].rstrip(b"\0").decode(errors="replace")


@functools.lru_cache(maxsize=1)
def names_in(payload: bytes) -> tuple[str, ...]:
    """Names of the bodies in a mocap frame, none of one that cannot be read."""
    try:
        frame = decode_as(payload, msg.RigidBodies)
    except MalformedPayloadError:
        return ()
    return tuple(body.rigid_body_name for body in frame.rigidbodies)


def quoted(names: Sequence[str], most: int = 8) -> str:
    """Names in words, a few of many.

    >>> quoted(["1", "2"]), quoted([])
    ("'1', '2'", 'none')
    """
    told = ", ".join(map(repr, names[:most]))
    return f"{told} and {len(names) - most} more" if len(names) > most else told or "none"
