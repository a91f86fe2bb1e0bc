"""Records that hold arrays are compared by what they are, never by ``==`` over their fields.

``==`` of two arrays is an array, which is neither true nor false. The comparison that a dataclass is given
hides that as long as both records hold the same array object, and not even then from Python 3.13 on.
"""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import pkgutil
import sys
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

PACKAGES = ("formation", "controllers", "estimation", "hil")


def records() -> Iterator[type]:
    """Every dataclass of the four packages."""
    for package in PACKAGES:
        for found in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            if found.name.endswith(".__main__"):
                continue
            module = importlib.import_module(found.name)
            for each in vars(module).values():
                if isinstance(each, type) and is_dataclass(each) and each.__module__ == found.name:
                    yield each


@functools.cache
def imported_for_types(module: str) -> dict[str, Any]:
    """What a module imports for a type checker alone."""
    found: dict[str, Any] = {}
    source = inspect.getsource(sys.modules[module])
    for block in ast.parse(source).body:
        if isinstance(block, ast.If) and getattr(block.test, "id", "") == "TYPE_CHECKING":
            for each in block.body:
                if isinstance(each, ast.ImportFrom) and each.module:
                    origin = vars(importlib.import_module(each.module))
                    names = [name for name in each.names if name.name in origin]
                    found |= {name.asname or name.name: origin[name.name] for name in names}
    return found


def held_types(record: type) -> list[Any]:
    """Types of a record's fields, for a dataclass or a named tuple."""
    names = [each.name for each in fields(record)] if is_dataclass(record) else record._fields  # type: ignore[attr-defined]
    # Classes that rosbags generates name both without importing them.
    known = {"ClassVar": ClassVar, "np": np} | imported_for_types(record.__module__)
    hints = typing.get_type_hints(record, localns=known)
    return [hints[name] for name in names]


def holds_array(kind: Any, within: tuple[type, ...] = ()) -> bool:
    """Whether a value of a type may hold an array, however deep."""
    # What NDArray[...] is depends on numpy's version.
    if {np.ndarray, typing.get_origin(NDArray[Any])} & {kind, typing.get_origin(kind)}:
        return True
    if typing.get_origin(kind) is Callable:
        return False
    if isinstance(kind, type) and (is_dataclass(kind) or hasattr(kind, "_fields")):
        return kind not in within and any(holds_array(each, (*within, kind)) for each in held_types(kind))
    return any(holds_array(each, within) for each in typing.get_args(kind))


def compares_fields(record: type) -> bool:
    """Whether a dataclass has the comparison that is made for it."""
    return record.__dataclass_params__.eq and "__eq__" in vars(record)  # type: ignore[attr-defined]


def test_no_record_with_an_array_is_compared_field_by_field() -> None:
    found = {each for each in records() if holds_array(each)}
    assert {"TruePath", "RunData", "LeaderEstimate", "InvariantSet"} <= {each.__name__ for each in found}
    wrong = sorted(f"{each.__module__}.{each.__name__}" for each in found if compares_fields(each))
    assert not wrong, "give these eq=False: " + ", ".join(wrong)


class Named(NamedTuple):
    values: NDArray[np.float64]


@dataclass
class Direct:
    values: NDArray[np.float64] | None


@dataclass
class Deep:
    inner: dict[str, tuple[Direct, ...]]


@dataclass
class Tupled:
    named: Named


@dataclass
class Plain:
    number: float
    again: Plain | None
    fill: Callable[[NDArray[np.float64]], None]


@pytest.mark.parametrize(("record", "holds"), [(Direct, True), (Deep, True), (Tupled, True), (Plain, False)])
def test_arrays_are_found_however_deep(record: type, holds: bool) -> None:
    assert holds_array(record) is holds
    assert compares_fields(record)
