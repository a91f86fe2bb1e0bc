"""What a node is given to take in."""

from __future__ import annotations

from msgspec import Struct


class Event(Struct, frozen=True):
    """What happens to a node: a payload on a topic or, with an empty ``topic``, the passing of time."""

    topic: str = ""
    payload: bytes = b""


TICK = Event()
