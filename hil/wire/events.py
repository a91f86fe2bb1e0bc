"""What a node is given to take in, and the name by which its outputs call it."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field

_SIGN, _TWICE_SIGN = 1 << 63, 1 << 64


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
