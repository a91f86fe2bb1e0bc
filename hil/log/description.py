"""What a log says of itself in its messages: its metadata, for tools that copy messages and nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from hil.wire.message_types import String
from hil.wire.messages import MalformedPayloadError, decode_as, encode

RECORD = "abreast"
"""Metadata record without which nobody knows how a log was made."""

ORIGIN = "abreast.log"
"""Record that messages alone have: ``begun_ns``, log time of the first message that there was."""

SETTLED_NS = 60_000_000_000
"""What is known only after a run has begun, as a certificate is live, is said by then."""


def description(metadata: Mapping[str, Mapping[str, str]], begun_ns: int) -> bytes:
    """Metadata records of a log as the payload of a message: JSON, entries by name of their record."""
    records = {**metadata, ORIGIN: {"begun_ns": str(begun_ns)}}
    return encode(String(data=json.dumps(records, separators=(",", ":"))))


def described(payloads: Iterable[bytes]) -> dict[str, dict[str, str]]:
    """Metadata records out of such messages: each as the last one had it that could be read."""
    records: dict[str, dict[str, str]] = {}
    for payload in payloads:
        try:
            told = json.loads(decode_as(payload, String).data)
        except (MalformedPayloadError, ValueError):
            continue
        if isinstance(told, dict):
            records |= {name: entries for name, entries in told.items() if _is_record(entries)}
    return records


def _is_record(entries: object) -> bool:
    return isinstance(entries, dict) and all(isinstance(value, str) for value in entries.values())
