"""The kernel gives what ``hashlib`` does, compiled and in plain Python."""

from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.kernel import entry, interpreted
from hil.wire.blake2b import BLOCK_BYTES, digest_of


@entry
def compiled_digest(padded: bytes, length: int) -> int:
    return digest_of(padded, length)


def expected(payload: bytes) -> int:
    found = hashlib.blake2b(payload, digest_size=8).digest()
    return int.from_bytes(found, "little", signed=True)


def padded(payload: bytes) -> bytes:
    return payload + bytes(-len(payload) % BLOCK_BYTES or (0 if payload else BLOCK_BYTES))


@given(st.binary(max_size=700))
def test_digests_are_those_of_hashlib(payload: bytes) -> None:
    assert compiled_digest(padded(payload), len(payload)) == expected(payload)


@pytest.mark.parametrize("length", [0, 1, 127, 128, 129, 256, 300])
def test_plain_python_gives_the_same(length: int) -> None:
    payload = bytes(k * 7 % 256 for k in range(length))
    assert interpreted(compiled_digest)(padded(payload), length) == expected(payload)
