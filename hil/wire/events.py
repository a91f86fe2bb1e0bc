"""What a node is given to take in, and the name by which its outputs call it."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field
from typing import NamedTuple

_SIGN, _TWICE_SIGN = 1 << 63, 1 << 64


NUMBERS = 1 << 32
"""So many numbers a publisher has for what it sends, and begins anew after that."""


class Origin(NamedTuple):
    """Who sent a payload: a Zenoh session and one of its publishers, which numbers what it sends."""

    session: str
    publisher: int
    number: int

    @property
    def sender(self) -> str:
        """Session and publisher, without the number."""
        return f"{self.session}/{self.publisher}"

    def is_after(self, other: Origin) -> bool:
        """Whether this is later than another payload of the same sender.

        >>> Origin("7f", 1, 5).is_after(Origin("7f", 1, 4))
        True
        """
        return 0 < (self.number - other.number) % NUMBERS < NUMBERS // 2


@dataclass(slots=True, unsafe_hash=True)
class Event:
    """What happens to a node: a payload on a topic or, with an empty ``topic``, the passing of time.

    ``origin``: who sent it, None where the sender does not say; bridges and foreign programs do not. It is
    for the shell: no step of a node looks at it.
    Nobody changes one: it is handed to all that take it in.
    """

    topic: str = ""
    payload: bytes = b""
    origin: Origin | None = field(default=None, compare=False)
    _digest: int | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def digest(self) -> int:
        """What receipts call it, :func:`digest` of its topic and payload; made once."""
        if self._digest is None:
            self._digest = digest(self.topic, self.payload)
        return self._digest

    @property
    def signed_digest(self) -> int:
        """The same 64 bits taken for a signed number, as rows hold it."""
        digest = self.digest
        return digest - _TWICE_SIGN if digest >= _SIGN else digest


TICK = Event()

OVERSIZED = b"oversized"
"""What is handed on in the place of a payload too large for any message; itself a message of no type."""


def digest(topic: str, payload: bytes) -> int:
    """Identify a payload on a topic by 64 bits of BLAKE2b, so that a log can say what a step consumed."""
    hasher = _begun(topic).copy()
    hasher.update(payload)
    return int.from_bytes(hasher.digest(), "little")


@functools.lru_cache(maxsize=1024)
def _begun(topic: str) -> hashlib.blake2b:
    """What hashes of all payloads on a topic begin with."""
    return hashlib.blake2b(topic.encode() + b"\0", digest_size=8)
