"""Text of a recording, whatever program wrote it: its encoding, its lines, and where it is damaged."""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import NamedTuple

from hil.errors import UsageError

LARGEST_BYTES = 1 << 30
"""Files above this are refused: what is read lies in memory, at some four times its size."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with byte order mark"),
    (codecs.BOM_UTF32_LE, "utf-32-le", "UTF-32"),
    (codecs.BOM_UTF32_BE, "utf-32-be", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16"),
)
_WIDTH = {"utf-16-le": 2, "utf-16-be": 2, "utf-32-le": 4, "utf-32-be": 4}
_LOOKED_AT_BYTES = 4096
_CONTROL = frozenset(range(9)) | frozenset(range(14, 32)) - {26}


class Text(NamedTuple):
    """Lines of a file without their ends, blank ones too, and how it was encoded.

    ``whole``: the file ends with the end of a line. ``damage``: what is wrong with it as a file, one phrase
    each.
    """

    lines: list[str]
    encoding: str
    whole: bool
    damage: tuple[str, ...] = ()


def read_text(path: Path) -> Text:
    """Read a file of text: UTF-8, UTF-16 or UTF-32 with or without a byte order mark, or Windows-1252.

    Raises :class:`UsageError` for a file that isn't there, cannot be read, is larger than
    :data:`LARGEST_BYTES`, or is no text.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_BYTES + 1)
    except FileNotFoundError:
        raise UsageError(f"recording {path}: no such file; check the path") from None
    except OSError as error:
        raise UsageError(f"recording {path}: cannot be read ({error.strerror})") from None
    if len(data) > LARGEST_BYTES:
        raise UsageError(
            f"recording {path}: has more than {LARGEST_BYTES >> 20} MB; split it, or export fewer columns"
        )
    text, encoding = _decoded(path, data)
    zeros = len(text) - len(text.rstrip("\0"))
    damage = (f"it ends in {zeros} zero bytes, as after a power cut",) if zeros else ()
    text = text.rstrip("\0\x1a").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    whole = lines[-1] == "" and not zeros
    return Text(lines[:-1] if lines[-1] == "" else lines, encoding, whole, damage)


def _decoded(path: Path, data: bytes) -> tuple[str, str]:
    for mark, codec, name in _MARKS:
        if data.startswith(mark):
            return _wide(data[len(mark) :], codec), name
    head = data[:_LOOKED_AT_BYTES]
    even, odd = head[0::2].count(0), head[1::2].count(0)
    # Letters and digits of UTF-16 have a zero each, all on one side.
    if max(even, odd) > 0.4 * len(head) / 2 and min(even, odd) < 0.1 * len(head) / 2:
        return _wide(data, "utf-16-be" if even > odd else "utf-16-le"), "UTF-16"
    # Zeros are left to damage, which a file of text may have; other control characters it has none.
    if sum(byte in _CONTROL for byte in head if byte) > 0.01 * len(head):
        raise UsageError(f"recording {path}: not readable as CSV (it is no text); expected a table of text")
    try:
        return data.decode("utf-8"), "ASCII" if data.isascii() else "UTF-8"
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace"), "Windows-1252"


def _wide(data: bytes, codec: str) -> str:
    """Text of an encoding with units of several bytes, without a unit that the file was cut off in."""
    cut = len(data) % _WIDTH.get(codec, 1)
    return data[: len(data) - cut].decode(codec, errors="replace")
