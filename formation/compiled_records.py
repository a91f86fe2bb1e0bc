"""What compiled code makes of :mod:`formation.records`: rows, bytes, and changed named tuples."""

from __future__ import annotations

import functools
import inspect
from typing import Any, NamedTuple, get_type_hints

from llvmlite import ir
from numba import types
from numba.core.typing import signature as typing_signature
from numba.core.typing.templates import AttributeTemplate, Signature, bound_function
from numba.extending import infer_getattr, lower_builtin, type_callable
from numba.np.arrayobj import populate_array

from formation import byte_access, records

_SCALARS: dict[Any, Any] = {float: types.float64, int: types.int64, bool: types.boolean}
BYTES = types.Bytes(types.uint8, 1, "C", readonly=True)
"""Type of ``bytes``."""

_FLOAT_BYTES = 8
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


def _walk(context: Any, builder: Any, kind: Any, place: _Place, value: Any) -> Any:
    """Load a nested named tuple from its place (``value`` None), or store it there."""
    parts = []
    for position, name in enumerate(kind.fields):
        part, here = kind.types[position], place.field(kind.instance_class, name)
        given = None if value is None else builder.extract_value(value, position)
        if isinstance(part, types.BaseNamedTuple):
            parts.append(_walk(context, builder, part, here, given))
            continue
        is_flag = part == types.boolean
        held = _BYTE if is_flag else context.get_value_type(part)
        pointer = here.pointer(builder, held)
        if given is not None:
            done = builder.store(builder.zext(given, _BYTE) if is_flag else given, pointer)
        else:
            done = builder.load(pointer)
            parts.append(builder.icmp_signed("!=", done, _BYTE(0)) if is_flag else done)
        done.set_metadata("tbaa", here.tag(builder.module))
    return None if value is not None else context.make_tuple(builder, kind, parts)


class _Place(NamedTuple):
    """A row in memory, or a field of it: where the row begins, then the field's names, type and offset.

    paths: from each record that holds it, the row's own first. apart: how many records lie field by field.
    """

    row: Any
    paths: tuple[str, ...]
    dtype: Any
    offset: int
    apart: int = 1

    def field(self, owner: type, name: str) -> _Place:
        dtype, offset = self.dtype.fields[name][:2]
        paths = (*self.paths, f"{owner.__module__}.{owner.__qualname__}")
        paths = tuple(f"{path}.{name}" for path in paths)
        return _Place(self.row, paths, dtype, self.offset + offset, self.apart)

    def pointer(self, builder: Any, held: Any) -> Any:
        at = builder.gep(self.row, [ir.Constant(_WORD, self.offset * self.apart)], inbounds=True)
        return builder.bitcast(at, held.as_pointer())

    def tag(self, module: Any) -> Any:
        """What tells LLVM that no other field of any record lies here: rows never share memory.

        But for those :func:`formation.records.within` others: a field is one of every record that holds it.
        """
        scalar = module.add_metadata(["rows"])
        for path in reversed(self.paths):
            scalar = module.add_metadata([path, scalar, ir.Constant(_WORD, 0)])
        return module.add_metadata([scalar, scalar, ir.Constant(_WORD, 0)])


def _row(
    context: Any, builder: Any, record: Any, rows_type: Any, rows: Any, index: Any, apart: int = 1
) -> _Place:
    dtype = records.dtype_of(record.instance_class)
    span = dtype.itemsize if apart == 1 else _FLOAT_BYTES
    if isinstance(rows_type, types.Array):
        array = context.make_array(rows_type)(context, builder, rows)
        base = builder.bitcast(array.data, _BYTE.as_pointer())
    else:
        base = builder.inttoptr(builder.extract_value(rows, 0), _BYTE.as_pointer())
    row = builder.gep(base, [builder.mul(index, ir.Constant(_WORD, span))], inbounds=True)
    return _Place(row, (), dtype, 0, apart)


def _teach(function: Any, typer: Any, code: Any) -> None:
    """Have compiled code type calls of a function by its arguments, and put its code where they are.

    An overload would be a function of its own for each of its types, and typed anew wherever it is called.
    """
    type_callable(function)(lambda context: typer)
    lower_builtin(function, types.VarArg(types.Any))(code)


def _teach_rows() -> None:
    span = record_type(records.Span)

    def typed_load(kind: Any, rows: Any, k: Any) -> Any:
        return typing_signature(record_type(kind.instance_class), kind, rows, types.int64)

    def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        record, (_, rows, _) = signature.return_type, signature.args
        place = _row(context, builder, record, rows, *arguments[1:])
        return _walk(context, builder, record, place, None)

    def typed_store(rows: Any, k: Any, record: Any) -> Any:
        return typing_signature(types.none, rows, types.int64, record_type(record.instance_class))

    def store(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows, _, record = signature.args
        place = _row(context, builder, record, rows, *arguments[:2])
        _walk(context, builder, record, place, arguments[2])
        return context.get_dummy_value()

    def borrowed(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return context.make_tuple(builder, span, [builder.ptrtoint(array.data, _WORD), array.nitems])

    def part(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        size = ir.Constant(_WORD, records.dtype_of(signature.args[0].instance_class).itemsize)
        begin = builder.add(builder.extract_value(arguments[1], 0), builder.mul(arguments[2], size))
        return context.make_tuple(builder, span, [begin, arguments[3]])

    def typed_load_across(kind: Any, rows: Any, count: Any, k: Any) -> Any:
        if not isinstance(count, types.IntegerLiteral):
            return None
        return typing_signature(record_type(kind.instance_class), kind, rows, count, types.int64)

    def load_across(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        record, (_, rows, count, _) = signature.return_type, signature.args
        at, k = arguments[1], arguments[3]
        place = _row(context, builder, record, rows, at, k, count.literal_value)
        return _walk(context, builder, record, place, None)

    def typed_store_across(rows: Any, count: Any, k: Any, record: Any) -> Any:
        if not isinstance(count, types.IntegerLiteral):
            return None
        return typing_signature(types.none, rows, count, types.int64, record_type(record.instance_class))

    def store_across(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows, count, _, record = signature.args
        at, k = arguments[0], arguments[2]
        place = _row(context, builder, record, rows, at, k, count.literal_value)
        _walk(context, builder, record, place, arguments[3])
        return context.get_dummy_value()

    def typed_within(kind: Any, rows: Any, k: Any, name: Any) -> Any:
        if not isinstance(name, types.StringLiteral):
            return None
        return typing_signature(span, kind, rows, types.int64, name)

    def within(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, rows, _, name = signature.args
        place = _row(context, builder, kind, rows, *arguments[1:3])
        offset = ir.Constant(_WORD, place.dtype.fields[name.literal_value][1])
        at = builder.add(builder.ptrtoint(place.row, _WORD), offset)
        return context.make_tuple(builder, span, [at, ir.Constant(_WORD, 1)])

    def size(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (rows,) = signature.args
        if isinstance(rows, types.Array):
            return context.make_array(rows)(context, builder, arguments[0]).nitems
        return builder.extract_value(arguments[0], 1)

    _teach(records.load, typed_load, load)
    _teach(records.store, typed_store, store)
    _teach(records.borrowed, lambda rows: typing_signature(span, rows), borrowed)
    _teach(
        records.part,
        lambda kind, rows, first, count: typing_signature(span, kind, rows, types.int64, types.int64),
        part,
    )
    _teach(records.load_across, typed_load_across, load_across)
    _teach(records.store_across, typed_store_across, store_across)
    _teach(records.within, typed_within, within)
    _teach(records.size, lambda rows: typing_signature(types.int64, rows), size)


# Bytes


def _bytes_base(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.BaseNamedTuple):
        return builder.extract_value(value, 0)
    return builder.ptrtoint(context.make_array(kind)(context, builder, value).data, _WORD)


def _bytes_at(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    base = _bytes_base(context, builder, signature.args[0], arguments[0])
    place = builder.inttoptr(builder.add(base, arguments[1]), _BYTE.as_pointer())
    array = context.make_array(BYTES)(context, builder)
    one = ir.Constant(_WORD, 1)
    # Without an owner: who called in keeps the bytes alive.
    populate_array(array, place, [arguments[2]], [one], one, meminfo=None)
    return array._getvalue()


def _teach_read(function: Any, width: int, result: Any, signed: bool) -> None:
    def read(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.add(_bytes_base(context, builder, signature.args[0], arguments[0]), arguments[1])
        held = ir.DoubleType() if result == types.float64 else ir.IntType(width)
        got = builder.load(builder.inttoptr(place, held.as_pointer()), align=1)
        if result == types.float64:
            return got
        return builder.sext(got, _WORD) if signed else builder.zext(got, _WORD)

    _teach(function, lambda payload, at: typing_signature(result, payload, types.int64), read)


def _teach_write(function: Any, width: int, kind: Any) -> None:
    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.add(_bytes_base(context, builder, signature.args[0], arguments[0]), arguments[1])
        held = ir.DoubleType() if kind == types.float64 else ir.IntType(width)
        given = arguments[2]
        if kind != types.float64 and width < 64:
            given = builder.trunc(given, held)
        builder.store(given, builder.inttoptr(place, held.as_pointer()), align=1)
        return context.get_dummy_value()

    _teach(function, lambda buffer, at, value: typing_signature(types.none, buffer, types.int64, kind), write)


def _teach_bytes() -> None:
    _teach_read(byte_access.read_float, 64, types.float64, signed=True)
    _teach_read(byte_access.read_int32, 32, types.int64, signed=True)
    _teach_read(byte_access.read_uint32, 32, types.int64, signed=False)
    _teach_read(byte_access.read_int64, 64, types.int64, signed=True)
    _teach_read(byte_access.read_byte, 8, types.int64, signed=False)
    _teach(
        byte_access.bytes_at,
        lambda source, at, length: typing_signature(BYTES, source, types.int64, types.int64),
        _bytes_at,
    )
    _teach_write(byte_access.write_float, 64, types.float64)
    _teach_write(byte_access.write_int32, 32, types.int64)
    _teach_write(byte_access.write_int64, 64, types.int64)
    _teach_write(byte_access.write_byte, 8, types.int64)


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
