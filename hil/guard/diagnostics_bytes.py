"""Diagnostics of one node as bytes, ``diagnostic_msgs/DiagnosticArray``, written without a general codec."""

from __future__ import annotations

import struct
from collections.abc import Mapping

_HEAD = b"\x00\x01\x00\x00"
_NS_PER_S = 1_000_000_000


def diagnostics_bytes(name: str, stamp_ns: int, problem: str, values: Mapping[str, object]) -> bytes:
    """The state of a node: OK without a problem, else WARN with the problem as message.

    The same bytes as those of :func:`hil.nodes.node.diagnostics`, which needs a codec.
    """
    out = bytearray()
    sec, nanosec = divmod(stamp_ns, _NS_PER_S)
    out += struct.pack("<iI", sec, nanosec)
    _text(out, "")
    _number(out, 1)
    out.append(1 if problem else 0)
    for text in (f"abreast/{name}", problem or "ok", ""):
        _text(out, text)
    _number(out, len(values))
    for key, value in values.items():
        _text(out, key)
        _text(out, str(value))
    return _HEAD + bytes(out)


def _number(out: bytearray, value: int) -> None:
    out += bytes(-len(out) % 4)
    out += struct.pack("<I", value)


def _text(out: bytearray, text: str) -> None:
    encoded = text.encode() + b"\0"
    _number(out, len(encoded))
    out += encoded
