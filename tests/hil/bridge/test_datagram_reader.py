"""Reading from a datagram: never beyond its end, each cause by its name."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError

INT = struct.Struct("<i")


@given(number=st.integers(-(2**31), 2**31 - 1), text=st.text().filter(lambda text: "\0" not in text))
def test_what_is_written_is_read(number: int, text: str) -> None:
    raw = text.encode("utf-8", "ignore") + b"\0"
    reader = DatagramReader(INT.pack(number) + raw + b"end")
    assert reader.take(INT) == (number,)
    assert reader.text() == raw[:-1].decode()
    assert reader.rest() == b"end"
    assert reader.left == 0


@pytest.mark.parametrize(
    ("data", "read", "cause"),
    [
        (b"abc", lambda reader: reader.take(INT), "short"),
        (b"abc", lambda reader: reader.skip(4), "short"),
        (b"abc", lambda reader: reader.skip(-1), "short"),
        (b"abc", lambda reader: reader.text(), "text"),
        (INT.pack(3) + b"ab", lambda reader: reader.count(), "count"),
        (INT.pack(1) + b"abcde", lambda reader: reader.count(6), "count"),
        (INT.pack(-1) + b"abcde", lambda reader: reader.count(), "count"),
        (INT.pack(6) + b"abcde", lambda reader: reader.size(), "size"),
        (INT.pack(-2) + b"abcde", lambda reader: reader.size(), "size"),
    ],
)
def test_what_is_not_there_is_refused_by_its_cause(data: bytes, read: object, cause: str) -> None:
    assert callable(read)
    with pytest.raises(MalformedDatagramError) as caught:
        read(DatagramReader(data))
    assert caught.value.cause == cause


def test_what_just_fits_is_taken() -> None:
    assert DatagramReader(INT.pack(2) + b"ab").count() == 2
    assert DatagramReader(INT.pack(1) + b"abcdef").count(6) == 1
    assert DatagramReader(INT.pack(2) + b"ab").size() == 2
