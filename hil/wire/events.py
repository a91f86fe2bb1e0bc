"""What a node is given to take in, and the name by which its outputs call it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field


@dataclass(slots=True, unsafe_hash=True)
class Event:
    """What happens to a node: a payload on a topic or, with an empty ``topic``, the passing of time.

    Nobody changes one: it is handed to all that take it in.
    """

    topic: str = ""
    payload: bytes = b""
    _digest: int | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def digest(self) -> int:
        """What receipts call it, :func:`digest` of its topic and payload; made once."""
        if self._digest is None:
            self._digest = digest(self.topic, self.payload)
        return self._digest


TICK = Event()


def digest(topic: str, payload: bytes) -> int:
    """Identify a payload on a topic by 64 bits of BLAKE2b, so that a log can say what a step consumed."""
    name = topic.encode()
    return int.from_bytes(hashlib.blake2b(name + b"\0" + payload, digest_size=8).digest(), "little")
