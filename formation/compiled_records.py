"""What compiled code makes of :mod:`formation.records`: rows, bytes, and changed named tuples."""

from __future__ import annotations

import functools
import inspect
from typing import Any, get_type_hints

from llvmlite import ir
from numba import types
from numba.core.typing import signature as typing_signature
from numba.core.typing.templates import AttributeTemplate, Signature, bound_function
from numba.extending import infer_getattr, intrinsic, lower_builtin, overload

from formation import records

_SCALARS: dict[Any, Any] = {float: types.float64, int: types.int64, bool: types.boolean}
_BYTE = ir.IntType(8)
_WORD = ir.IntType(64)


@functools.cache
def record_type(kind: Any) -> Any:
    """Numba's type of a scalar or named tuple. Raises :class:`TypeError` for anything else."""
    if kind in _SCALARS:
        return _SCALARS[kind]
    if not records.is_record(kind):
        raise TypeError(f"compiled code cannot take {kind}, expected a number or a named tuple of such")
    hints = get_type_hints(kind, include_extras=True)
    held = [hints[name] for name in records.fields_of(kind)]
    parts = [record_type(records.Span if records.is_lent(hint) else hint) for hint in held]
    if all(part == parts[0] for part in parts):
        return types.NamedUniTuple(parts[0], len(parts), kind)
    return types.NamedTuple(parts, kind)


def teach_records() -> None:
    """Tell numba of all that this module has; loading it has done so for tuples."""
    _teach_rows()
    _teach_bytes()


# Rows: load and store


def _walk(context: Any, builder: Any, kind: Any, dtype: Any, base: Any, value: Any) -> Any:
    """Load a nested named tuple from an address (``value`` None), or store it there."""
    parts = []
    for position, name in enumerate(kind.fields):
        part = kind.types[position]
        part_dtype, offset = dtype.fields[name][:2]
        given = None if value is None else builder.extract_value(value, position)
        if isinstance(part, types.BaseNamedTuple):
            place = builder.add(base, ir.Constant(_WORD, offset))
            parts.append(_walk(context, builder, part, part_dtype, place, given))
            continue
        is_flag = part == types.boolean
        held = _BYTE if is_flag else context.get_value_type(part)
        pointer = builder.inttoptr(builder.add(base, ir.Constant(_WORD, offset)), held.as_pointer())
        if given is not None:
            builder.store(builder.zext(given, _BYTE) if is_flag else given, pointer)
        else:
            got = builder.load(pointer)
            parts.append(builder.icmp_signed("!=", got, _BYTE(0)) if is_flag else got)
    return None if value is not None else context.make_tuple(builder, kind, parts)


def _address(context: Any, builder: Any, rows_type: Any, rows: Any, index: Any, itemsize: int) -> Any:
    if isinstance(rows_type, types.Array):
        array = context.make_array(rows_type)(context, builder, rows)
        base = builder.ptrtoint(array.data, _WORD)
    else:
        base = builder.extract_value(rows, 0)
    return builder.add(base, builder.mul(index, ir.Constant(_WORD, itemsize)))


@intrinsic
def _load(typing_context: Any, kind: Any, rows: Any, k: Any) -> Any:
    record, dtype = record_type(kind.instance_class), records.dtype_of(kind.instance_class)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base = _address(context, builder, rows, arguments[1], arguments[2], dtype.itemsize)
        return _walk(context, builder, record, dtype, base, None)

    return record(kind, rows, types.int64), code


@intrinsic
def _store(typing_context: Any, rows: Any, k: Any, value: Any) -> Any:
    record, dtype = record_type(value.instance_class), records.dtype_of(value.instance_class)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base = _address(context, builder, rows, arguments[0], arguments[1], dtype.itemsize)
        _walk(context, builder, record, dtype, base, arguments[2])
        return context.get_dummy_value()

    return types.none(rows, types.int64, record), code


def _teach_rows() -> None:
    span = records.Span

    def borrow(rows):
        return lambda rows: span(rows.ctypes.data, len(rows))

    def count(rows):
        if isinstance(rows, types.Array):
            return lambda rows: len(rows)
        return lambda rows: rows.length

    overload(records.load, inline="always")(lambda kind, rows, k: lambda kind, rows, k: _load(kind, rows, k))
    overload(records.store, inline="always")(
        lambda rows, k, record: lambda rows, k, record: _store(rows, k, record)
    )

    def cut(kind, rows, first, count):
        itemsize = records.dtype_of(kind.instance_class).itemsize
        return lambda kind, rows, first, count: span(rows.address + first * itemsize, count)

    overload(records.borrowed, inline="always")(borrow)
    overload(records.part, inline="always")(cut)
    overload(records.size, inline="always")(count)


# Bytes


def _bytes_base(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.BaseNamedTuple):
        return builder.extract_value(value, 0)
    return builder.ptrtoint(context.make_array(kind)(context, builder, value).data, _WORD)


def _reader(width: int, result: Any, signed: bool) -> Any:
    @intrinsic
    def read(typing_context: Any, payload: Any, at: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.add(_bytes_base(context, builder, payload, arguments[0]), arguments[1])
            held = ir.DoubleType() if result == types.float64 else ir.IntType(width)
            got = builder.load(builder.inttoptr(place, held.as_pointer()), align=1)
            if result == types.float64:
                return got
            return builder.sext(got, _WORD) if signed else builder.zext(got, _WORD)

        return result(payload, types.int64), code

    return read


def _writer(width: int, kind: Any) -> Any:
    @intrinsic
    def write(typing_context: Any, buffer: Any, at: Any, value: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.add(_bytes_base(context, builder, buffer, arguments[0]), arguments[1])
            held = ir.DoubleType() if kind == types.float64 else ir.IntType(width)
            given = (
                arguments[2] if kind == types.float64 or width == 64 else builder.trunc(arguments[2], held)
            )
            builder.store(given, builder.inttoptr(place, held.as_pointer()), align=1)
            return context.get_dummy_value()

        return types.none(buffer, types.int64, kind), code

    return write


def _teach_bytes() -> None:
    for function, read in (
        (records.read_float, _reader(64, types.float64, signed=True)),
        (records.read_int32, _reader(32, types.int64, signed=True)),
        (records.read_uint32, _reader(32, types.int64, signed=False)),
        (records.read_byte, _reader(8, types.int64, signed=False)),
    ):
        overload(function, inline="always")(_calling_read(read))
    for put, write in (
        (records.write_float, _writer(64, types.float64)),
        (records.write_int32, _writer(32, types.int64)),
        (records.write_int64, _writer(64, types.int64)),
        (records.write_byte, _writer(8, types.int64)),
    ):
        overload(put, inline="always")(_calling_write(write))


def _calling_read(read: Any) -> Any:
    return lambda payload, at: lambda payload, at: read(payload, at)


def _calling_write(write: Any) -> Any:
    return lambda buffer, at, value: lambda buffer, at, value: write(buffer, at, value)


# Named tuples: x._replace(field=value), and methods


class _Named(Signature):
    """Signature of a method that still knows the names of its arguments when it is lowered."""

    def as_function(self) -> Any:
        return typing_signature(self.return_type, self.recvr, *self.args).replace(pysig=self.pysig)

    def replace(self, **changes: Any) -> Any:
        kept = {name: getattr(self, name) for name in ("return_type", "args", "recvr", "pysig")}
        return _Named(**(kept | changes))


@infer_getattr
class _Replace(AttributeTemplate):
    key = types.BaseNamedTuple

    @bound_function("namedtuple._replace")
    def resolve__replace(self, record: Any, positional: Any, named: Any) -> Any:
        parts = tuple(record.types[record.fields.index(name)] for name in named)
        parameters = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in named]
        return _Named(record, parts, recvr=record, pysig=inspect.Signature(parameters))


@lower_builtin("namedtuple._replace", types.BaseNamedTuple, types.VarArg(types.Any))
def _lower_replace(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    record, value = signature.args[0], arguments[0]
    for name, new in zip(signature.pysig.parameters, arguments[1:], strict=True):
        value = builder.insert_value(value, new, record.fields.index(name))
    return value
