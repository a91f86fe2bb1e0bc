"""How two series of messages differ, told per topic: how many, from when on, and by how much.

Compared to the bit, or within a tolerance where other hardware rounds otherwise.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.log.reader import Record
from hil.wire.message_types import Consumed, Time
from hil.wire.messages import MalformedPayloadError, decode

TOLERANCE = 1e-9
"""By how much numbers may differ, absolute up to 1 and relative beyond, and times in seconds."""


@dataclass(frozen=True, slots=True)
class Sent:
    """A message as it went over the wire, and when [ns]."""

    typename: str
    payload: bytes
    at_ns: int


def by_topic(records: Iterable[Record]) -> dict[str, list[Sent]]:
    """Messages of a log by their topic, in log order."""
    found: dict[str, list[Sent]] = {}
    for record in records:
        found.setdefault(record.topic, []).append(Sent(record.typename, record.payload, record.log_ns))
    return found


def differences(
    was: Mapping[str, Sequence[Sent]],
    now: Mapping[str, Sequence[Sent]],
    *,
    exactly: bool,
    since_ns: int | None = None,
) -> list[str]:
    """A line for each topic whose messages differ, in the order of names; none if all are the same.

    ``exactly``: to the bit, else within :data:`TOLERANCE`, and then the digests in receipts may be any:
    they are those of payloads, which differ with the last bit of any number. Times in the lines [s] count
    from ``since_ns``, without it from the first message of ``was``.
    """
    first_ns = min((sent.at_ns for series in was.values() for sent in series), default=0)
    zero_ns = first_ns if since_ns is None else since_ns
    lines = (
        _difference(name, was.get(name, ()), now.get(name, ()), zero_ns, exactly=exactly)
        for name in sorted(was.keys() | now.keys())
    )
    return [line for line in lines if line]


def _difference(topic: str, was: Sequence[Sent], now: Sequence[Sent], zero_ns: int, *, exactly: bool) -> str:
    wrong: list[Sent] = []
    most: float = 0.0
    other = False
    for old, new in zip(was, now, strict=False):
        if old == new:
            continue
        by, beyond, unlike = _distance(old, new)
        if exactly or beyond or unlike:
            wrong.append(old)
            most = max(most, by)
            other |= unlike
    count = max(len(was), len(now))
    lacking = count - min(len(was), len(now))
    if not wrong and not lacking:
        return ""
    first = wrong[0] if wrong else max(was, now, key=len)[min(len(was), len(now))]
    said = [
        f"{topic}: {len(wrong) + lacking} of {count} differ, first at {(first.at_ns - zero_ns) * 1e-9:.3f} s"
    ]
    if wrong:
        said.append(f"by at most {most:.3g}")
    if other:
        said.append("in more than numbers")
    if lacking:
        said.append(f"{len(was)} were, {len(now)} are")
    return ", ".join(said)


def _distance(old: Sent, new: Sent) -> tuple[float, bool, bool]:
    """Greatest difference of two numbers, whether any is too great, and whether other things differ."""
    if old.typename != new.typename:
        return 0.0, False, True
    try:
        parts = _leaves(decode(old.payload, old.typename)), _leaves(decode(new.payload, new.typename))
    except MalformedPayloadError:
        return 0.0, False, old.payload != new.payload
    pairs = [((old.at_ns, "ns"), (new.at_ns, "ns")), *itertools.zip_longest(*parts)]
    most, beyond, unlike = 0.0, False, False
    for before, after in pairs:
        if before is None or after is None or before[1] != after[1]:
            unlike = True
            continue
        left, right, kind = before[0], after[0], before[1]
        if kind == "digest":
            continue
        if kind == "ns":
            by = abs(left - right) * 1e-9
        elif kind == "number":
            by = _apart(left, right)
        else:
            unlike |= bool(left != right)
            continue
        most = max(most, by)
        scale = max(1.0, abs(left), abs(right)) if kind == "number" and math.isfinite(by) else 1.0
        beyond |= by > TOLERANCE * scale
    return most, beyond, unlike


def _apart(left: float, right: float) -> float:
    if left == right or (math.isnan(left) and math.isnan(right)):
        return 0.0
    by = abs(left - right)
    return math.inf if math.isnan(by) else by


def _leaves(value: Any) -> Iterator[tuple[Any, str]]:
    """All that a message is made of, in order, each with its kind: number, ns, digest or other."""
    if isinstance(value, Time):
        yield value.sec * 1_000_000_000 + value.nanosec, "ns"
    elif isinstance(value, Consumed):
        yield value.digest, "digest"
        yield from _leaves(value.received)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            # The classes of rosbags count their type name and their constants as fields.
            if field.name[0] != "_" and not field.name.isupper():
                yield from _leaves(getattr(value, field.name))
    elif isinstance(value, list | tuple | np.ndarray):
        for part in value:
            yield from _leaves(part)
    elif isinstance(value, float | np.floating):
        yield float(value), "number"
    else:
        yield value, "other"
