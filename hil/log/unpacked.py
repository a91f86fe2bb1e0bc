"""Logs that are read from a temporary copy: of what was compressed, and of what is whole of a damaged one."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import zstandard

from hil.errors import UsageError
from hil.log.reader import DamagedLogError, Log, Record, damaged, read_log
from hil.log.recovery import recover

_PIECE_BYTES = 1 << 12
_UNSUSPICIOUS_BYTES = 64 << 20
_HIGHEST_RATIO = 1000


class Copy:
    """A temporary file, there for as long as this lives."""

    def __init__(self, name: str) -> None:
        folder = tempfile.mkdtemp(prefix="abreast-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self.file = Path(folder) / name


def unpacked(path: Path) -> Copy:
    """What is in a zstd-compressed file. Raises :class:`UsageError` if it cannot be unpacked."""
    copy = Copy(path.stem)
    try:
        with path.open("rb") as packed, copy.file.open("wb") as target:
            if not _unpack(packed, target):
                raise damaged(path, "it is cut off")
    except zstandard.ZstdError as error:
        raise damaged(path, str(error)) from None
    except FileNotFoundError:
        raise UsageError(f"log {path}: no such file; check the path") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"log {path}: cannot be unpacked into {copy.file.parent} ({reason})") from None
    return copy


def in_place_of(path: Path, inner: Log, copy: Copy) -> Log:
    """A log in a copy, as that of the file that the copy was made of."""
    return replace(inner, path=path, channels={}, chunks=(), source=partial(_records, copy, inner))


def salvaged(path: Path) -> Log:
    """What is whole of a damaged MCAP, as a log that says what is gone.

    Raises :class:`UsageError` if nothing is.
    """
    copy = Copy(path.name)
    done = recover(path, copy.file)
    log = in_place_of(path, read_log(copy.file), copy)
    return log if done.complete else replace(log, damage=f"the log is damaged: {done.said()}")


def whole_or_salvaged(path: Path) -> Log:
    """An MCAP as a log, without what is damaged of it. Raises as :func:`hil.log.reader.read_log`."""
    try:
        return read_log(path)
    except DamagedLogError:
        return salvaged(path)


def _unpack(packed: BinaryIO, target: BinaryIO) -> bool:
    """Unpack a file of frames; whether the last of them is whole.

    Raises :class:`zstandard.ZstdError` for one that becomes larger than any log does.
    """
    frame = zstandard.ZstdDecompressor().decompressobj()
    taken = given = 0
    # In small pieces, as each is unpacked at once.
    while piece := packed.read(_PIECE_BYTES):
        taken += len(piece)
        while piece:
            if frame.eof:
                frame = zstandard.ZstdDecompressor().decompressobj()
            given += target.write(frame.decompress(piece))
            if given > _UNSUSPICIOUS_BYTES + _HIGHEST_RATIO * taken:
                raise zstandard.ZstdError(f"its first {taken} bytes become {given} and more, as no log's do")
            piece = frame.unused_data
    return frame.eof


def _records(
    _held: Copy, inner: Log, topics: Collection[str] | None, start_ns: int | None, end_ns: int | None
) -> Iterator[Record]:
    """Messages of a copy, which is there for as long as it is held."""
    yield from inner.records(topics, start_ns, end_ns)
