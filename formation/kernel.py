"""One decorator for what is written once: a kernel is plain Python, and compiles where compiled code calls.

``@kernel`` marks a plain typed function over scalars and named tuples. From Python it is just that function.
``@entry`` marks the few functions by which Python enters compiled code: they compile for the types that they
are annotated with, together with all kernels that they call, and give the same bits as the plain function.

Nothing of the compiler is loaded before the first entry is made, and where numba is not installed, or the
environment has ABREAST_INTERPRETED=1, all stays plain Python: limits and guard run on a robot that has none.

What keeps the bits the same: no ``**``, no ``math.hypot`` or ``math.dist`` in a kernel (the interpreter has
its own), which a test looks for; no division that may be by zero (it raises in Python), floats written as
floats.
"""

from __future__ import annotations

import functools
import importlib.util
import os
from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

from formation.marked import MARKED, PLAIN, Marked

F = TypeVar("F", bound=Callable[..., Any])


@overload
def kernel(function: F) -> F: ...
@overload
def kernel(*, inline: bool) -> Callable[[F], F]: ...
def kernel(function: F | None = None, *, inline: bool = True) -> F | Callable[[F], F]:
    """Mark a function, or a method of a named tuple, as a kernel; it stays what it is.

    A large one that is called from several places is better not taken ``inline``: it would be compiled anew
    for each of them.

    >>> @kernel
    ... def doubled(x: float) -> float:
    ...     return 2.0 * x
    >>> doubled(1.5)
    3.0
    """

    def marked(function: F) -> F:
        MARKED.append(Marked(function, inline))
        return function

    return marked if function is None else marked(function)


def entry(function: F) -> F:
    """Compile a function for the types of its annotations, now or out of the cache.

    It takes and returns ``int``, ``float``, ``bool``, ``bytes``, named tuples of these,
    :class:`formation.records.Rows` of named tuples, and the arrays named there. Its module must be loaded as
    far as its annotations need, so that entries stand below the kernels that they call. Arguments go by
    position; that rows are of the type that is annotated is left to mypy, nothing looks at it again here.
    """
    if not compiles():
        return function
    from formation import compiler

    compiled: F = compiler.compiled(function)
    return compiled


def interpreted(function: F) -> F:
    """The plain Python function behind an entry."""
    plain: Any = PLAIN.get(function, function)
    return cast("F", plain)


@functools.cache
def compiles() -> bool:
    """Whether entries are compiled here: numba is installed and nobody asked for plain Python."""
    if os.environ.get("ABREAST_INTERPRETED", "") not in ("", "0"):
        return False
    return importlib.util.find_spec("numba") is not None
