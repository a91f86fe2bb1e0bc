"""A function is called by its address with the same answer from compiled code and from Python."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from formation.address import Address, called
from formation.first_class import FirstClass
from formation.kernel import compiles, entry
from formation.records import Rows, load, row_of


class Seen(NamedTuple):
    a: float
    b: float


class Else(NamedTuple):
    c: float


class Own(NamedTuple):
    k: float


class Whole(NamedTuple):
    a: float
    b: float
    c: float


@entry
def sum_by_address(at: Rows[Address], whole: Rows[Whole]) -> float:
    first, second = called(load(Address, at, 0), load(Whole, whole, 0))
    return first + second


def weighed(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    return doubled(seen.a) * own.k, math.sin(seen.b) / other.c


def doubled(value: float) -> float:
    return 2.0 * value


def by_import(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    import cmath

    return 2.0 * seen.a * own.k, cmath.sin(seen.b).real / other.c


def text(seen: Seen, other: Else, own: Own) -> Any:
    return "left", "right"


def three(seen: Seen, other: Else, own: Own) -> Any:
    return seen.a, seen.b, 0.0


def endless(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    return math.inf, 0.0


def strict(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    if seen.a > 1.0:
        raise ValueError("a is too large")
    return seen.a, own.k


def leaving(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    sys.exit("good\nbye")


def interrupted(seen: Seen, other: Else, own: Own) -> tuple[float, float]:
    raise KeyboardInterrupt


class Forgetful:
    """It gives an answer from the second time on, and cannot be hashed."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self) -> None:
        self.asked = 0

    def __call__(self, seen: Seen, other: Else, own: Own) -> tuple[float, float]:
        self.asked += 1
        return (math.nan if self.asked < 3 else 1.0), 2.0


def first_class(function: Callable[..., Any]) -> FirstClass:
    return FirstClass(function, (Seen, Else), Own)


def both_ways(function: FirstClass, at: Address, whole: Whole) -> set[float]:
    answer = called(at, whole)
    return {sum_by_address(row_of(at), row_of(whole)), answer[0] + answer[1]}


@pytest.mark.parametrize("function", [weighed, by_import])
def test_compiled_code_and_python_get_the_same_answer(function: Callable[..., Any]) -> None:
    found = first_class(function)
    whole = Whole(1.25, 0.3, 0.7)
    for k in (0.5, 3.0):
        assert both_ways(found, found.at(k), whole) == {2.5 * k + math.sin(0.3) / 0.7}
    assert found.failures() == 0
    assert found.failure() == ""


@pytest.mark.skipif(not compiles(), reason="numba is not in use")
def test_what_can_be_compiled_is_and_what_cannot_says_why() -> None:
    assert first_class(weighed).compiled
    found = first_class(by_import)
    assert not found.compiled
    assert "IMPORT_NAME" in found.why_not
    assert "\n" not in found.why_not


def test_addresses_of_the_same_numbers_are_the_same() -> None:
    found = first_class(weighed)
    assert found.at(1.0) == found.at(1.0) != found.at(2.0)


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (weighed, "ZeroDivisionError: float division by zero"),
        (strict, "ValueError: a is too large"),
        (endless, "it gave (inf, 0.0), expected two finite numbers"),
        (text, "it gave ('left', 'right'), expected two finite numbers"),
        (leaving, "SystemExit: good bye"),
        (Forgetful(), "it failed, but gave (1.0, 2.0) when asked the same again; it may not have a memory"),
        (three, "it gave (2.0, 0.5, 0.0), expected two finite numbers"),
    ],
)
def test_a_failure_answers_nan_is_counted_and_named(function: Callable[..., Any], why: str) -> None:
    found, whole = first_class(function), Whole(2.0, 0.5, 0.0)
    at = found.at(1.0)
    assert all(map(math.isnan, called(at, whole)))
    assert math.isnan(sum_by_address(row_of(at), row_of(whole)))
    assert found.failures() == 2
    assert found.failure() == why


@pytest.mark.parametrize("function", [functools.partial(weighed), Forgetful(), math.atan2, Own])
@pytest.mark.skipif(not compiles(), reason="numba is not in use")
def test_what_is_no_plain_function_is_asked_in_python(function: Any) -> None:
    assert first_class(function).why_not == f"it is no plain function but {type(function).__name__}"


@pytest.mark.skipif(not compiles(), reason="numba is not in use")
def test_what_numba_has_already_compiles() -> None:
    from numba import njit

    assert first_class(njit(weighed)).compiled


@pytest.mark.skipif(not compiles(), reason="numba is not in use")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_leaves_no_answer_behind() -> None:
    found = first_class(interrupted)
    assert math.isnan(sum_by_address(row_of(found.at(1.0)), row_of(Whole(2.0, 0.5, 0.0))))
