"""Calls by address, as numba has them: for :mod:`formation.first_class`."""

from __future__ import annotations

import inspect
import types as python
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from formation.address import called

_FLOATS = types.CPointer(types.float64)
_PAIR = types.UniTuple(types.float64, 2)
_SIGNATURE = types.int64(_FLOATS, _FLOATS, _FLOATS)
_PYTHON_DIVISION = "python"  # so that a division by zero raises whether compiled or not


class NotCompiledError(Exception):
    """numba cannot compile a function; the text says why, in one line."""


@intrinsic  # type: ignore[untyped-decorator]
def _call(typing_context: Any, function: Any, numbers: Any, asked: Any) -> Any:
    """Call a C function at an address with what is asked, its numbers, and room for two floats."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double, integer = ir.DoubleType(), ir.IntType(64)
        size = len(asked)
        room = cgutils.alloca_once(builder, ir.ArrayType(double, size))
        for k in range(size):
            place = cgutils.gep_inbounds(builder, room, 0, k)
            builder.store(builder.extract_value(args[2], k), place)
        answer = cgutils.alloca_once(builder, ir.ArrayType(double, 2))
        pointer = ir.FunctionType(integer, [integer, integer, integer]).as_pointer()
        entered = builder.inttoptr(args[0], pointer)
        builder.call(entered, [builder.ptrtoint(room, integer), args[1], builder.ptrtoint(answer, integer)])
        return builder.load(answer)

    return _PAIR(types.int64, types.int64, asked), code


def teach_calls() -> None:
    """Tell numba what :func:`formation.address.called` is."""
    overload(called, strict=False)(lambda *args: _at_an_address)


def _at_an_address(at: Any, asked: Any) -> Any:
    return _call(at.function, at.numbers, asked)


def c_function(function: Callable[..., Any], asked: Sequence[type[Any]], numbers: type[Any]) -> Any:
    """C function with an ``address``, that enters a function of two records and its numbers.

    Raises :class:`NotCompiledError` for a function that numba cannot compile.
    """
    from numba.np.unsafe.ndarray import to_fixed_tuple

    first, second = asked
    one, other, own = len(first._fields), len(second._fields), len(numbers._fields)
    size = one + other
    _teach_neighbours(function, set())
    law = njit(function, error_model=_PYTHON_DIVISION)

    def entered(asked_at: Any, numbers_at: Any, answer_at: Any) -> int:
        asked, memory = carray(asked_at, size), carray(numbers_at, own + 1 + size)
        answer = carray(answer_at, 2)
        given = first(*to_fixed_tuple(asked[:one], one)), second(*to_fixed_tuple(asked[one:], other))
        v, u = float("nan"), float("nan")
        try:
            v, u = law(given[0], given[1], numbers(*to_fixed_tuple(memory[:own], own)))
        except Exception:
            v = float("nan")
        if not (abs(v) < float("inf") and abs(u) < float("inf")):
            v, u = float("nan"), float("nan")
            memory[own] += 1.0
            memory[own + 1 :] = asked
        answer[0], answer[1] = v, u
        return 0

    try:
        return cfunc(_SIGNATURE)(entered)
    except Exception as error:  # numba has several kinds for what it cannot, of no common ancestor
        raise NotCompiledError(_in_one_line(error)) from None


def _teach_neighbours(function: Callable[..., Any], known: set[str]) -> None:
    """Let numba compile the plain functions of its module that a function calls, and those that they call."""
    code, names = function.__code__, function.__globals__
    for name in code.co_names:
        neighbour = names.get(name)
        if name in known or not inspect.isfunction(neighbour):
            continue
        known.add(name)
        if neighbour.__module__ == function.__module__ and neighbour is not function:
            overload(neighbour, strict=False)(_as_it_is(neighbour))
            _teach_neighbours(neighbour, known)


def _as_it_is(function: python.FunctionType) -> Callable[..., Any]:
    return lambda *args, **kwargs: function


def _in_one_line(error: Exception) -> str:
    """What numba says about it: the last line that is neither its advice nor a place in a file."""
    lines = [line.strip() for line in str(error).splitlines()]
    told = [
        line for line in lines if line and not line.startswith(("File ", "During", "-", "^", "This error"))
    ]
    return " ".join(told[1:2] or told[:1]) or type(error).__name__
