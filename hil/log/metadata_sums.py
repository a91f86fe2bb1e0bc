"""Sums over what a log says of itself: a scenario of which a byte has changed would be another experiment."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

RECORD = "abreast.sha256"
"""Metadata record with the SHA-256 of other ones by their names."""

Records = Mapping[str, Mapping[str, str]]
"""Metadata records: entries by the record's name."""


def sums_of(records: Records) -> dict[str, str]:
    """SHA-256 of each record, as 64 hex digits: of its entries as JSON with sorted keys and no spaces."""
    return {name: _sum_of(entries) for name, entries in records.items() if name != RECORD}


def changed(records: Records, sums: Mapping[str, str]) -> list[str]:
    """Names of the records that are not what they were summed as, or not there at all."""
    return [name for name, told in sums.items() if name not in records or _sum_of(records[name]) != told]


def _sum_of(entries: Mapping[str, str]) -> str:
    text = json.dumps(dict(entries), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
