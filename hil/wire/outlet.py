"""A publisher as others know it: who it is, and the number of each message."""

from __future__ import annotations

import hashlib
import struct
import time
from dataclasses import dataclass

import zenoh

from hil.wire.events import NUMBERS, Origin

_ATTACHED = struct.Struct("<qqB16s")


@dataclass(slots=True)
class Outlet:
    """A publisher; ``gid``: what rmw_zenoh knows it by, empty where nobody asks; ``sent``: how many."""

    publisher: zenoh.Publisher
    gid: bytes = b""
    sent: int = 0

    def put(self, payload: bytes) -> None:
        """Publish a payload with its number, from 1 on."""
        self.sent += 1
        told = zenoh.SourceInfo(self.publisher.id, self.sent % NUMBERS)
        if not self.gid:
            self.publisher.put(payload, source_info=told)
            return
        # Without number, time and sender rmw_zenoh drops what it gets.
        attached = attachment(self.sent, time.time_ns(), self.gid)
        self.publisher.put(payload, attachment=attached, source_info=told)


def origin_of(sample: zenoh.Sample) -> Origin | None:
    """Who sent a sample, None where it does not say."""
    told = sample.source_info
    if told is None:
        return _attached(sample.attachment)
    sender = told.source_id
    return Origin(str(sender.zid), sender.eid, told.source_sn)


def _attached(attached: zenoh.ZBytes | None) -> Origin | None:
    """Who sent a message of rmw_zenoh, by what it attaches."""
    held = attached.to_bytes() if attached is not None else b""
    if len(held) != _ATTACHED.size:
        return None
    number, _, length, gid = _ATTACHED.unpack(held)
    return Origin(gid.hex(), 0, number % NUMBERS) if length == len(gid) else None


UNSIGNED = "somebody without a session"
"""Who sent a message that says nothing of its sender."""


def sender_of(origin: Origin | None) -> str:
    """Whom to name for a message."""
    return f"session {origin.session}" if origin is not None else UNSIGNED


def gid_of(told: str) -> bytes:
    """Sixteen bytes by which rmw_zenoh knows a publisher, of its token or of what else tells it apart."""
    return hashlib.blake2b(told.encode(), digest_size=16).digest()


def attachment(number: int, stamp_ns: int, gid: bytes) -> bytes:
    """What rmw_zenoh has with every message: its number from 1 on, its time, and 16 bytes of its sender."""
    return _ATTACHED.pack(number, stamp_ns, len(gid), gid)
