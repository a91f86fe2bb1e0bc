"""Functions that are given at run time: compiled code calls them by their address, as it is.

Such a function takes named tuples of floats and returns two floats. What numba can compile is called at the
cost of a pointer; what it cannot goes back into the interpreter from where it is called, by the same address.
In plain Python :func:`formation.address.called` finds the function by that address, too.

A function that raises, or returns anything but two finite numbers, answers NaN and NaN; how often it did, and
what it was asked then, stays behind its numbers, so that :meth:`FirstClass.failure` can tell why.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formation.address import ANSWERS, NO_ANSWER, Address
from formation.kernel import compiles

_ENTERED = ctypes.CFUNCTYPE(ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
_ANSWER = ctypes.c_double * 2


class FirstClass:
    """A function with an address: ``function(*asked, numbers) -> (float, float)``.

    ``asked``: types of the named tuples that it is called with; ``numbers``: that of its last argument, which
    stays the same over many calls. ``compiled``: whether numba could; ``why_not`` tells what it said if not.
    """

    def __init__(self, function: Callable[..., Any], asked: Sequence[type[Any]], numbers: type[Any]) -> None:
        self.function = function
        self.why_not = "" if compiles() else "numba is not in use"
        self._asked = [(kind, len(kind._fields)) for kind in asked]
        self._numbers = numbers
        self._size = sum(size for _, size in self._asked)
        self._own = len(numbers._fields)
        self._room = ctypes.c_double * self._size
        self._memories: dict[tuple[float, ...], NDArray[np.float64]] = {}
        self._records: dict[int, tuple[Any, NDArray[np.float64]]] = {}
        self._entered: Any = None
        if not self.why_not:
            self._compile(asked)
        if self._entered is None:
            self._entered = _ENTERED(self._enter)
            self.address: int = ctypes.cast(self._entered, ctypes.c_void_p).value or 0
        ANSWERS[self.address] = self.answer

    @property
    def compiled(self) -> bool:
        """Whether calls stay in compiled code."""
        return not self.why_not

    def at(self, *numbers: float) -> Address:
        """Address to call the function by with these numbers; it is good for as long as the process lives."""
        if numbers not in self._memories:
            memory = np.zeros(self._own + 1 + self._size)
            memory[: self._own] = numbers
            self._memories[numbers] = memory
            self._records[memory.ctypes.data] = self._numbers(*map(float, numbers)), memory
        return Address(self.address, self._memories[numbers].ctypes.data)

    def answer(self, asked: Sequence[float], numbers: int) -> tuple[float, float]:
        """Answer in plain Python; NaN and NaN if there is none, which is counted."""
        record, memory = self._records[numbers]
        try:
            if (pair := _pair(self.function(*self._records_of(asked), record))) is not None:
                return pair
        except (Exception, SystemExit):  # whatever somebody's function may raise
            pass
        memory[self._own] += 1.0
        memory[self._own + 1 :] = asked
        return NO_ANSWER

    def failures(self) -> int:
        """How often there was no answer."""
        return int(sum(memory[self._own] for memory in self._memories.values()))

    def failure(self) -> str:
        """Why there was none the last time that there was none; empty if there always was one."""
        failed = [memory for memory in self._memories.values() if memory[self._own]]
        if not failed:
            return ""
        record, memory = self._records[failed[-1].ctypes.data]
        try:
            answer = self.function(*self._records_of(memory[self._own + 1 :].tolist()), record)
        except (Exception, SystemExit) as error:  # whatever somebody's function may raise
            return " ".join(f"{type(error).__name__}: {error}".split())
        with contextlib.suppress(Exception):
            if _pair(answer) is not None:
                return f"it failed, but gave {answer!r} when asked the same again; it may not have a memory"
        return f"it gave {answer!r}, expected two finite numbers"

    def _compile(self, asked: Sequence[type[Any]]) -> None:
        from formation.compiled_calls import NotCompiledError, c_function

        try:
            self._entered = c_function(self.function, asked, self._numbers)
            self.address = self._entered.address
        except NotCompiledError as error:
            self.why_not = str(error)

    def _records_of(self, asked: Sequence[float]) -> list[Any]:
        records, at = [], 0
        for kind, size in self._asked:
            records.append(kind(*asked[at : at + size]))
            at += size
        return records

    def _enter(self, asked: int, numbers: int, answer: int) -> int:
        """What compiled code calls where the function could not be compiled."""
        given = _ANSWER.from_address(answer)
        given[:] = [*NO_ANSWER]  # what stays there if this is interrupted
        given[:] = [*self.answer(self._room.from_address(asked)[:], numbers)]
        return 0


def _pair(answer: Any) -> tuple[float, float] | None:
    """An answer as two floats, None if they are not finite. Raises for what is no pair of numbers."""
    first, second = answer
    return (float(first), float(second)) if math.isfinite(first) and math.isfinite(second) else None
