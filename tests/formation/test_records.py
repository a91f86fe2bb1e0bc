from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.kernel import entry, interpreted
from formation.records import (
    Rows,
    borrowed,
    columns_of,
    dtype_of,
    fields_of,
    is_record,
    load,
    load_across,
    row_of,
    rows_of,
    size,
    store,
    store_across,
    within,
)
from tests.bits import same_bits


class Inner(NamedTuple):
    flag: bool
    real: float


class Outer(NamedTuple):
    whole: int
    first: Inner
    flag: bool
    second: Inner
    real: float


inners = st.builds(Inner, st.booleans(), st.floats())
outers = st.builds(Outer, st.integers(-(2**63), 2**63 - 1), inners, st.booleans(), inners, st.floats())


@entry
def swapped(rows: Rows[Outer], left: int, right: int) -> Inner:
    one, other = load(Outer, rows, left), load(Outer, rows, right)
    store(rows, left, other._replace(second=one.second))
    store(rows, right, one)
    return other.first


@entry
def changed_within(rows: Rows[Outer], k: int, real: float) -> float:
    lent = borrowed(rows)
    first, second = within(Outer, lent, k, "first"), within(Outer, lent, k, "second")
    before = load(Outer, lent, k)
    store(first, 0, Inner(not before.first.flag, real))
    store(second, 0, load(Outer, lent, k).first)
    # Seen through the whole, what was stored in a part must have come before.
    store(lent, k, load(Outer, lent, k)._replace(real=load(Inner, second, 0).real))
    store(first, 0, before.second)
    return load(Outer, lent, k).first.real


@given(st.lists(outers, min_size=2, max_size=3), st.floats())
def test_a_part_of_a_row_is_changed_where_it_is(records: list[Outer], real: float) -> None:
    compiled, plain = rows_of(Outer, len(records)), rows_of(Outer, len(records))
    for rows in (compiled, plain):
        for k, record in enumerate(records):
            store(rows, k, record)
    at = len(records) - 1
    new = Inner(not records[at].first.flag, real)
    expected = records[at]._replace(first=records[at].second, second=new, real=real)
    same_bits(changed_within(compiled, at, real), records[at].second.real)
    same_bits(interpreted(changed_within)(plain, at, real), records[at].second.real)
    for rows in (compiled, plain):
        same_bits(load(Outer, rows, at), expected)
        same_bits(load(Outer, rows, 0), records[0])


class Two(NamedTuple):
    first: float
    second: float


class Pair(NamedTuple):
    real: float
    two: Two


@entry
def exchanged_across(rows: Rows[Pair], k: int, real: float) -> float:
    lent = borrowed(rows)
    before = load_across(Pair, lent, 3, k)
    store_across(lent, 3, k, Pair(real, Two(before.real, before.two.first)))
    return before.two.second


reals = st.lists(st.floats(), min_size=9, max_size=9)


@given(reals, st.integers(0, 2), st.floats())
def test_records_lie_field_by_field(numbers: list[float], k: int, real: float) -> None:
    compiled, plain = rows_of(Pair, 3), rows_of(Pair, 3)
    for rows in (compiled, plain):
        for each in range(3):
            first, *rest = numbers[3 * each : 3 * each + 3]
            store_across(rows, 3, each, Pair(first, Two(*rest)))
        np.testing.assert_array_equal(columns_of(rows).view(np.float64)[:3], numbers[::3])
    first, second, third = numbers[3 * k : 3 * k + 3]
    same_bits(exchanged_across(compiled, k, real), third)
    same_bits(interpreted(exchanged_across)(plain, k, real), third)
    assert columns_of(compiled).tobytes() == columns_of(plain).tobytes()
    same_bits(load_across(Pair, plain, 3, k), Pair(real, Two(first, second)))


@given(st.lists(outers, min_size=2, max_size=5))
def test_rows_give_back_what_was_put_there_to_the_last_bit(records: list[Outer]) -> None:
    rows = rows_of(Outer, len(records))
    for k, record in enumerate(records):
        store(rows, k, record)
    assert size(rows) == len(rows) == len(records)
    for k, record in enumerate(records):
        found = load(Outer, rows, k)
        same_bits(found, record)
        assert type(found) is Outer
        assert type(found.first) is Inner
        assert [type(part) for part in (found.whole, found.flag, found.real)] == [int, bool, float]


@given(st.lists(outers, min_size=2, max_size=5), st.integers(0, 9), st.integers(0, 9))
def test_compiled_code_reads_and_writes_the_same_rows(records: list[Outer], left: int, right: int) -> None:
    left, right = left % len(records), right % len(records)
    compiled, plain = rows_of(Outer, len(records)), rows_of(Outer, len(records))
    for rows in (compiled, plain):
        for k, record in enumerate(records):
            store(rows, k, record)
    same_bits(swapped(compiled, left, right), interpreted(swapped)(plain, left, right))
    assert columns_of(compiled).tobytes() == columns_of(plain).tobytes()


def test_columns_are_the_rows_themselves() -> None:
    rows = rows_of(Outer, 3)
    columns_of(rows)["second"]["real"] = [1.0, 2.0, math.inf]
    assert [load(Outer, rows, k).second.real for k in range(3)] == [1.0, 2.0, math.inf]
    store(rows, 1, load(Outer, rows, 1)._replace(whole=-7))
    assert columns_of(rows)["whole"].tolist() == [0, -7, 0]


def test_a_row_of_its_own_is_a_copy() -> None:
    record = Outer(1, Inner(True, 2.0), False, Inner(False, 3.0), 4.0)
    row = row_of(record)
    store(row, 0, record._replace(whole=5))
    assert load(Outer, row_of(record), 0) == record
    assert load(Outer, row, 0).whole == 5


def test_fields_lie_as_compiled_code_has_them() -> None:
    dtype = dtype_of(Outer)
    assert dtype.isalignedstruct
    assert dtype.names == fields_of(Outer) == ("whole", "first", "flag", "second", "real")
    assert dtype["first"] == dtype_of(Inner)
    assert [dtype[name] for name in ("whole", "flag", "real")] == [np.int64, np.bool_, np.float64]


def test_only_named_tuples_are_records() -> None:
    assert is_record(Outer)
    for other in (tuple, float, Outer(0, Inner(False, 0.0), False, Inner(False, 0.0), 0.0), list[Outer]):
        assert not is_record(other)


def test_a_list_serves_as_rows() -> None:
    kept: list[Inner] = [Inner(True, 1.0)]
    rows: Rows[Inner] = kept  # type: ignore[assignment]
    store(rows, 0, Inner(False, 2.0))
    assert load(Inner, rows, 0) == kept[0] == Inner(False, 2.0)


def test_a_field_that_no_row_can_hold_is_named() -> None:
    class Wrong(NamedTuple):
        names: list[str]

    with pytest.raises(TypeError, match=r"Wrong\.names is list\[str\], expected float, int, bool or a named"):
        rows_of(Wrong, 1)
