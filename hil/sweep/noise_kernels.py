"""The emulator's random numbers, drawn by compiled code: the same bits in a fraction of the time.

They are what numpy draws from its generator ``Philox`` by the ziggurat of ``Generator.standard_normal`` for
:func:`hil.emulator.mocap.draw_block`, which a test holds them to. Philox 4x64 with ten rounds turns a counter
into four words, whatever came before (Salmon and others, "Parallel random numbers: as easy as 1, 2, 3",
2011), so that the processor can have several counters under way at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.random._constants import fi_double, ki_double, wi_double, ziggurat_nor_inv_r, ziggurat_nor_r
from numpy.typing import NDArray

Words = NDArray[np.uint64]
Numbers = NDArray[np.float64]

_F = TypeVar("_F", bound=Callable[..., object])

_WORDS = 256
"""Words that are drawn ahead; a multiple of four."""
_SEED, _STREAM, _BLOCK, _COUNTER, _TAKEN = 0, 1, 2, 3, 4
"""What a source has: whose numbers, of which block; the next counter, and how many of its words are taken."""

_FACTOR, _OTHER_FACTOR = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_STEP, _OTHER_STEP = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_MANTISSA, _SIGN, _LAYER = np.uint64(2**52 - 1), np.uint64(0x100), np.uint64(0xFF)
_NONE, _ONE, _EIGHT, _NINE, _ELEVEN = (np.uint64(number) for number in (0, 1, 8, 9, 11))
_RESOLUTION = 2.0**-53


def _compiled(*signature: object) -> Callable[[_F], _F]:
    """Compile for one signature now, or without one into every kernel that calls the function."""
    # A call would count references to its arrays, which takes longer than drawing a number.
    compiler: Any = njit(
        signature or None,
        cache=True,
        nogil=True,
        fastmath=False,
        error_model="numpy",
        forceinline=not signature,
    )
    decorate: Callable[[_F], _F] = compiler
    return decorate


def _product(typing_context: object, a: object, b: object) -> tuple[Any, Callable[..., Any]]:
    """Upper and lower word of the product of two words."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = arguments[0].type
        pair = type(word)(128)
        product = builder.mul(*(builder.zext(argument, pair) for argument in arguments))
        upper = builder.trunc(builder.lshr(product, pair(64)), word)
        return context.make_tuple(builder, signature.return_type, (upper, builder.trunc(product, word)))

    two_words: Any = types.UniTuple
    return two_words(types.uint64, 2)(types.uint64, types.uint64), code


_multiply: Any = intrinsic(_product)


@_compiled()
def _fill(words: Words, source: Words) -> None:
    """Draw words of the source's next counters."""
    for k in range(0, _WORDS, 4):
        source[_COUNTER] += _ONE
        a, b, c, d = source[_COUNTER], _NONE, _NONE, source[_BLOCK]
        key, other_key = source[_SEED], source[_STREAM]
        for _ in range(10):
            upper, lower = _multiply(_FACTOR, a)
            other_upper, other_lower = _multiply(_OTHER_FACTOR, c)
            a, b, c, d = other_upper ^ b ^ key, other_lower, upper ^ d ^ other_key, lower
            key, other_key = key + _STEP, other_key + _OTHER_STEP
        words[k], words[k + 1], words[k + 2], words[k + 3] = a, b, c, d
    source[_TAKEN] = _NONE


@_compiled()
def _word(words: Words, source: Words) -> Any:
    if source[_TAKEN] == _WORDS:
        _fill(words, source)
    taken = source[_TAKEN]
    source[_TAKEN] = taken + _ONE
    return words[taken]


@_compiled()
def _share(words: Words, source: Words) -> float:
    """Uniform number from 0 to 1, that excluded."""
    return float(_word(words, source) >> _ELEVEN) * _RESOLUTION


@_compiled()
def _beyond(words: Words, source: Words) -> float:
    """Normal beyond the last layer, without its sign."""
    while True:
        beyond = -ziggurat_nor_inv_r * math.log1p(-_share(words, source))
        height = -math.log1p(-_share(words, source))
        if height + height > beyond * beyond:
            return float(ziggurat_nor_r + beyond)


@_compiled()
def _normal(words: Words, source: Words) -> float:
    """Standard normal: a point of the layer that a word names, which nearly always is below the curve."""
    while True:
        word = _word(words, source)
        layer, size = word & _LAYER, (word >> _NINE) & _MANTISSA
        sign = -1.0 if word & _SIGN else 1.0
        x: float = sign * (size * wi_double[layer])
        if size < ki_double[layer]:
            return x
        if layer == 0:
            side = -1.0 if (size >> _EIGHT) & _ONE else 1.0
            return side * _beyond(words, source)
        upper, lower = fi_double[layer - _ONE], fi_double[layer]
        if (upper - lower) * _share(words, source) + lower < math.exp(-0.5 * x * x):
            return x


@_compiled(types.uint64, types.uint64, types.uint64, types.float64[::1], types.float64[::1])
def draw(seed: int, stream: int, block: int, normals: Numbers, shares: Numbers) -> None:
    """Fill with a block's numbers from the first on: standard normals, then uniform ones from 0 to 1."""
    words = np.empty(_WORDS, np.uint64)
    source = np.zeros(5, np.uint64)
    source[_SEED], source[_STREAM], source[_BLOCK], source[_TAKEN] = seed, stream, block, _WORDS
    for k in range(len(normals)):
        normals[k] = _normal(words, source)
    for k in range(len(shares)):
        shares[k] = _share(words, source)
