"""Calls by address, as numba has them: for :mod:`formation.first_class`."""

from __future__ import annotations

import inspect
import math
import types as python
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from formation.address import called

_PAIR = types.UniTuple(types.float64, 2)
_SIGNATURE = types.int64(types.int64, types.int64, types.int64)
_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)
_BYTES = 8  # of a float
_PYTHON_DIVISION = "python"  # so that a division by zero raises whether compiled or not


class NotCompiledError(Exception):
    """numba cannot compile a function; the text says why, in one line."""


@intrinsic  # type: ignore[untyped-decorator]
def _call(typing_context: Any, function: Any, numbers: Any, asked: Any) -> Any:
    """Call a C function at an address with what is asked, its numbers, and room for two floats."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        room = cgutils.alloca_once(builder, ir.ArrayType(_DOUBLE, len(asked)))
        for k in range(len(asked)):
            place = cgutils.gep_inbounds(builder, room, 0, k)
            builder.store(builder.extract_value(args[2], k), place)
        answer = cgutils.alloca_once(builder, ir.ArrayType(_DOUBLE, 2))
        entered = builder.inttoptr(args[0], ir.FunctionType(_WORD, [_WORD] * 3).as_pointer())
        builder.call(entered, [builder.ptrtoint(room, _WORD), args[1], builder.ptrtoint(answer, _WORD)])
        return builder.load(answer)

    return _PAIR(types.int64, types.int64, asked), code


def _pointer(builder: Any, address: Any, k: int = 0) -> Any:
    return builder.gep(builder.inttoptr(address, _DOUBLE.as_pointer()), [ir.Constant(_WORD, k)])


@intrinsic  # type: ignore[untyped-decorator]
def _read(typing_context: Any, address: Any) -> Any:
    """The float at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_pointer(builder, args[0]))

    return types.float64(types.int64), code


@intrinsic  # type: ignore[untyped-decorator]
def _write(typing_context: Any, address: Any, value: Any) -> Any:
    """Put a float at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[1], _pointer(builder, args[0]))
        return context.get_dummy_value()

    return types.none(types.int64, types.float64), code


def _reader(kind: type[Any]) -> Any:
    """What reads a named tuple of floats from an address."""
    size = len(kind._fields)
    record = types.NamedUniTuple(types.float64, size, kind)

    @intrinsic  # type: ignore[untyped-decorator]
    def read(typing_context: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            values = [builder.load(_pointer(builder, args[0], k)) for k in range(size)]
            return context.make_tuple(builder, record, values)

        return record(types.int64), code

    return read


def teach_calls() -> None:
    """Tell numba what :func:`formation.address.called` is."""
    overload(called, strict=False)(lambda *args: _at_an_address)


def _at_an_address(at: Any, asked: Any) -> Any:
    return _call(at.function, at.numbers, asked)


def c_function(function: Callable[..., Any], asked: Sequence[type[Any]], numbers: type[Any]) -> Any:
    """C function with an ``address``, that enters a function of two records and its numbers.

    Raises :class:`NotCompiledError` for a function that numba cannot compile.
    """
    first, second, own = map(_reader, (*asked, numbers))
    size = sum(len(kind._fields) for kind in asked)
    second_at = _BYTES * len(asked[0]._fields)
    failed_at = _BYTES * len(numbers._fields)
    plain = getattr(function, "py_func", function)  # one that numba has already, by njit
    if not inspect.isfunction(plain):
        raise NotCompiledError(f"it is no plain function but {type(function).__name__}")
    _teach_neighbours(plain, set())
    law = njit(plain, error_model=_PYTHON_DIVISION)

    def entered(asked_at: int, numbers_at: int, answer_at: int) -> int:
        v, u = math.nan, math.nan
        try:
            v, u = law(first(asked_at), second(asked_at + second_at), own(numbers_at))
        except Exception:
            v = math.nan
        if not (math.isfinite(v) and math.isfinite(u)):
            v, u = math.nan, math.nan
            counted = numbers_at + failed_at
            _write(counted, _read(counted) + 1.0)
            for k in range(size):
                _write(counted + _BYTES * (k + 1), _read(asked_at + _BYTES * k))
        _write(answer_at, v)
        _write(answer_at + _BYTES, u)
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
    """What numba says about it: the first line that is no stage, no advice and no place in a file."""
    lines = [line.strip() for line in str(error).splitlines()]
    aside = ("Failed in", "File ", "During", "-", "^", "This error")
    told = [line for line in lines if line and not line.startswith(aside)]
    return " ".join((told or lines)[:1]) or type(error).__name__
