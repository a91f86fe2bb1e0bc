"""The compiler behind :mod:`formation.kernel`: types, kernels and entries as numba has them.

Only this module and its neighbours import numba: :mod:`formation.compiled_records`,
:mod:`formation.compiled_calls`, :mod:`formation.compile_cache` and :mod:`formation.kernel_linking`. What they
rest on of its internals is held by ``tests/formation/test_kernel.py``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numba import from_dtype, njit, types
from numba.core.typing.templates import make_overload_method_template
from numba.extending import infer_getattr, overload

from formation import records
from formation.collector import collector_paused
from formation.compile_cache import cache_of, one_at_a_time
from formation.compiled_calls import teach_calls
from formation.compiled_records import BYTES, record_type, teach_records
from formation.kernel_linking import EntryCompiler, KernelCompiler
from formation.marked import MARKED, PLAIN, Marked

_JIT = {"error_model": "numpy", "fastmath": False}
_KERNEL = _JIT | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": KernelCompiler}
_ELEMENTS = {np.float64: types.float64, np.int64: types.int64, np.bool_: types.boolean, np.uint8: types.uint8}

DISPATCHERS: dict[Any, Any] = {}
"""What numba knows of each entry: it keeps the compiled code alive."""

_taught = 0
teach_records()
teach_calls()


def type_of(kind: Any) -> Any:
    """Numba's type of what an entry takes or returns. Raises :class:`TypeError` for what none can."""
    if kind is type(None):
        return types.none
    if kind is bytes:
        return BYTES
    if get_origin(kind) is records.Rows:
        return types.Array(from_dtype(records.dtype_of(get_args(kind)[0])), 1, "C")
    if array := getattr(kind, "__metadata__", ()):
        element, dimensions = array
        return types.Array(_ELEMENTS[element], dimensions, "C")
    return record_type(kind)


def compiled(function: Callable[..., Any]) -> Any:
    """Compiled form of a function for the types of its annotations; of many processes only one compiles."""
    _teach_new()
    hints = get_type_hints(function, include_extras=True)
    result = type_of(hints["return"])
    signature = result(*(type_of(hints[name]) for name in inspect.signature(function).parameters))
    dispatcher = njit(function, nogil=True, no_cfunc_wrapper=True, pipeline_class=EntryCompiler, **_JIT)
    cache = cache_of(function)
    if cache is not None:
        dispatcher._cache = cache
    # Compiling makes millions of objects that live to its end: looking through them takes a fifth of it.
    with one_at_a_time(function.__module__), collector_paused():
        dispatcher.compile(signature)
    dispatcher.disable_compile()
    # Called by itself it takes a fifth of the time: the dispatcher would look up the type of every argument.
    (overload_of_all,) = dispatcher.overloads.values()
    direct = overload_of_all.entry_point
    PLAIN[direct] = function
    DISPATCHERS[direct] = dispatcher
    return direct


def _teach_new() -> None:
    """Tell numba of the kernels that were marked since the last entry."""
    global _taught
    while _taught < len(MARKED):
        _taught += 1
        _teach(MARKED[_taught - 1])


def _teach(marked: Marked) -> None:
    function = marked.function
    options = _KERNEL | {"forceinline": marked.inline}
    owner, _, name = function.__qualname__.rpartition(".")
    if not owner or owner.endswith("<locals>"):
        overload(function, jit_options=options, strict=False)(lambda *args, **kwargs: function)
        return

    def method(record: Any, *args: Any, **kwargs: Any) -> Any:
        return function if getattr(record.instance_class, name, None) is function else None

    method.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    overload(method, jit_options=options, strict=False)(method)
    template = make_overload_method_template(types.BaseNamedTuple, name, method, inline="never")
    infer_getattr(type(name, (template,), {"_resolve": _resolve_unless_field, "_method": template._resolve}))


def _resolve_unless_field(template: Any, record: Any, name: str) -> Any:
    """A method as it is, but for records that have a field of its name."""
    return None if name in getattr(record, "fields", ()) else template._method(record, name)
