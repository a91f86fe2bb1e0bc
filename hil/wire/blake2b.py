"""BLAKE2b with a digest of eight bytes, as a kernel: receipts name inputs by it, thousands a second.

Words are signed 64-bit integers, which compiled code wraps by itself. Reference: RFC 7693.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formation.byte_access import read_int64
from formation.kernel import kernel

BLOCK_BYTES = 128
DIGEST_BYTES = 8

_LOW = (1 << 63) - 1
_ROUNDS = 12
_IV0, _IV1 = 0x6A09E667F3BCC908, 0xBB67AE8584CAA73B - (1 << 64)
_IV2, _IV3 = 0x3C6EF372FE94F82B, 0xA54FF53A5F1D36F1 - (1 << 64)
_IV4, _IV5 = 0x510E527FADE682D1, 0x9B05688C2B3E6C1F - (1 << 64)
_IV6, _IV7 = 0x1F83D9ABFB41BD6B, 0x5BE0CD19137E2179
_PARAMETERS = 0x01010000 + DIGEST_BYTES
"""Neither key nor tree, and how long the digest is."""

# By round, where each of the sixteen words of a block goes; times eight, as they lie there in bytes.
_PLACES = 8 * np.array(
    [
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
        [14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3],
        [11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4],
        [7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8],
        [9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13],
        [2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9],
        [12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11],
        [13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10],
        [6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5],
        [10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0],
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
        [14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3],
    ],
    dtype=np.int64,
).reshape(-1)


class _Four(NamedTuple):
    a: int
    b: int
    c: int
    d: int


class _Chain(NamedTuple):
    """What is carried from block to block."""

    h0: int
    h1: int
    h2: int
    h3: int
    h4: int
    h5: int
    h6: int
    h7: int


_BEGIN = _Chain(_IV0 ^ _PARAMETERS, _IV1, _IV2, _IV3, _IV4, _IV5, _IV6, _IV7)


@kernel(inline=False)
def digest_of(padded: bytes, length: int) -> int:
    """Digest of the first ``length`` bytes, taken for a signed number; zeros follow up to whole blocks.

    There is one block at least, also of nothing.
    """
    chain, at = _BEGIN, 0
    while length - at > BLOCK_BYTES:
        chain = _compressed(chain, padded, at, at + BLOCK_BYTES, 0)
        at += BLOCK_BYTES
    return _compressed(chain, padded, at, length, -1).h0


@kernel(inline=False)
def _compressed(chain: _Chain, padded: bytes, at: int, count: int, last: int) -> _Chain:
    """The chain with one more block; ``count``: bytes up to its end, ``last``: all bits set in the last."""
    v0, v1, v2, v3, v4, v5, v6, v7 = chain
    v8, v9, v10, v11 = _IV0, _IV1, _IV2, _IV3
    v12, v13, v14, v15 = _IV4 ^ count, _IV5, _IV6 ^ last, _IV7
    for turn in range(_ROUNDS):
        first = 16 * turn
        v0, v4, v8, v12 = _mixed(_Four(v0, v4, v8, v12), padded, at, first)
        v1, v5, v9, v13 = _mixed(_Four(v1, v5, v9, v13), padded, at, first + 2)
        v2, v6, v10, v14 = _mixed(_Four(v2, v6, v10, v14), padded, at, first + 4)
        v3, v7, v11, v15 = _mixed(_Four(v3, v7, v11, v15), padded, at, first + 6)
        v0, v5, v10, v15 = _mixed(_Four(v0, v5, v10, v15), padded, at, first + 8)
        v1, v6, v11, v12 = _mixed(_Four(v1, v6, v11, v12), padded, at, first + 10)
        v2, v7, v8, v13 = _mixed(_Four(v2, v7, v8, v13), padded, at, first + 12)
        v3, v4, v9, v14 = _mixed(_Four(v3, v4, v9, v14), padded, at, first + 14)
    return _Chain(
        chain.h0 ^ v0 ^ v8,
        chain.h1 ^ v1 ^ v9,
        chain.h2 ^ v2 ^ v10,
        chain.h3 ^ v3 ^ v11,
        chain.h4 ^ v4 ^ v12,
        chain.h5 ^ v5 ^ v13,
        chain.h6 ^ v6 ^ v14,
        chain.h7 ^ v7 ^ v15,
    )


@kernel
def _mixed(four: _Four, padded: bytes, at: int, place: int) -> _Four:
    """The mixing function G with two words of a block."""
    a, b, c, d = four
    a = _wrapped(a + b + read_int64(padded, at + _PLACES[place]))
    d = _turned(d ^ a, 32)
    c = _wrapped(c + d)
    b = _turned(b ^ c, 24)
    a = _wrapped(a + b + read_int64(padded, at + _PLACES[place + 1]))
    d = _turned(d ^ a, 16)
    c = _wrapped(c + d)
    return _Four(a, _turned(b ^ c, 63), c, d)


@kernel
def _turned(word: int, by: int) -> int:
    """A word rotated to the right."""
    return ((word >> by) & ((1 << (64 - by)) - 1)) | _wrapped(word << (64 - by))


@kernel
def _wrapped(word: int) -> int:
    """The low 64 bits as a signed number; compiled code has no others."""
    return (word & _LOW) + ((-((word >> 63) & 1)) << 63)
