"""Reads a datagram from its front to its end, and never beyond."""

from __future__ import annotations

import struct
from typing import Any

from hil.errors import AbreastError

_COUNT = struct.Struct("<i")


class MalformedDatagramError(AbreastError):
    """A datagram that is not what it says it is. ``cause``: in one word, by which it is counted."""

    def __init__(self, cause: str, text: str) -> None:
        super().__init__(f"{cause}: {text}")
        self.cause = cause


class DatagramReader:
    """A place in a datagram, little-endian and without padding. All that it gives lies before ``end``."""

    def __init__(self, data: bytes, at: int = 0) -> None:
        self._data = data
        self.at = at
        self.end = len(data)

    @property
    def left(self) -> int:
        """Bytes that were not read yet."""
        return self.end - self.at

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Values of a layout. Raises :class:`MalformedDatagramError` where the datagram ends before."""
        at = self.at
        self.skip(layout.size)
        return layout.unpack_from(self._data, at)

    def skip(self, size: int) -> None:
        """Pass over some bytes. Raises as :meth:`take` does."""
        if not 0 <= size <= self.left:
            raise MalformedDatagramError(
                "short", f"{size} bytes wanted at byte {self.at}, {self.left} are left"
            )
        self.at += size

    def count(self, least: int = 1) -> int:
        """How many items follow. Raises for more than fit if each has ``least`` bytes or more."""
        (number,) = self.take(_COUNT)
        if not 0 <= number * least <= self.left:
            raise MalformedDatagramError("count", f"{number} items cannot follow in {self.left} bytes")
        return int(number)

    def size(self) -> int:
        """How many bytes a part says that it has. Raises where the datagram ends before."""
        (number,) = self.take(_COUNT)
        if not 0 <= number <= self.left:
            raise MalformedDatagramError("size", f"a part of {number} bytes cannot follow in {self.left}")
        return int(number)

    def text(self) -> str:
        """A text that ends with a zero byte; what is no UTF-8 in it is replaced. Raises if none does."""
        stop = self._data.find(0, self.at, self.end)
        if stop < 0:
            raise MalformedDatagramError("text", f"the text at byte {self.at} has no end")
        found = self._data[self.at : stop].decode("utf-8", "replace")
        self.at = stop + 1
        return found

    def rest(self) -> bytes:
        """All that is left."""
        at, self.at = self.at, self.end
        return self._data[at : self.end]
