from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.kernel import entry, interpreted
from formation.leader import (
    Constant,
    Impulse,
    LeaderProgram,
    Program,
    Sinusoid,
    Table,
    TableRow,
    driven,
    encoded,
)
from formation.pose import Motion
from formation.records import Rows, borrowed


@entry
def driven_at(program: Program, table: Rows[TableRow], t: float) -> Motion:
    return driven(program, borrowed(table), t)


def test_leader_of_the_papers_simulation() -> None:
    program = Sinusoid(0.5, 0.5, 1.0, math.pi)
    assert program(0.0) == Motion(0.5, 0.5)
    assert program(0.5).u == pytest.approx(1.5)
    assert program.period == pytest.approx(2.0)


@given(st.floats(-20, 20), st.integers(-5, 5))
@settings(deadline=None)
def test_sinusoid_repeats_after_its_period(t: float, periods: int) -> None:
    program = Sinusoid(0.08, 0.2, 0.5, 0.5 * math.pi)
    assert program(t + 4.0 * periods).u == pytest.approx(program(t).u, abs=1e-12)


def test_impulse_is_a_bell() -> None:
    program = Impulse(0.5, 1.0, 5.0, 1.0)
    assert program(5.0) == Motion(0.5, 1.0)
    assert program(4.0).u == pytest.approx(math.exp(-0.5))
    assert program(6.0).u == program(4.0).u
    assert program(1e9).u == 0.0


@pytest.mark.parametrize("program", [Constant(0.5, 0.1), Impulse(0.5, 1.0, 5.0, 1.0), Table([0], [1], [2])])
def test_what_does_not_repeat_has_no_period(program: LeaderProgram) -> None:
    assert program.period is None


@given(
    st.lists(
        st.tuples(st.floats(-9, 9), st.floats(-1, 1), st.floats(-3, 3)), min_size=1, unique_by=lambda r: r[0]
    ),
    st.floats(-12, 12),
)
@settings(deadline=None)
def test_table_is_linear_between_and_held_outside(rows: list[tuple[float, float, float]], t: float) -> None:
    columns = [list(column) for column in zip(*sorted(rows), strict=True)]
    times, speeds, turns = columns
    motion = Table(times, speeds, turns)(t)
    expected = float(np.interp(t, times, speeds)), float(np.interp(t, times, turns))
    assert (motion.v, motion.u) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("t", "v", "message"),
    [
        ([0.0, 1.0], [1.0], "lengths"),
        ([], [], "lengths"),
        ([0.0, 0.0], [1.0, 1.0], r"t\[1\] = 0.0 after 0.0"),
        ([1.0, 0.0], [1.0, 1.0], r"t\[1\] = 0.0 after 1.0"),
        ([0.0, math.nan], [1.0, 1.0], r"t\[1\] = nan"),
    ],
)
def test_tables_without_sense_are_refused(t: list[float], v: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Table(t, v, [0.0] * len(t))


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_waves_and_bells_without_sense_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match=r"^omega is"):
        Sinusoid(0.5, 0.5, 1.0, bad)
    with pytest.raises(ValueError, match=r"^t_width is"):
        Impulse(0.5, 1.0, 5.0, bad)


def test_programs_name_the_step_that_misses_nothing() -> None:
    assert Constant(0.5).longest_step == math.inf
    assert Sinusoid(0.5, 0.1, 0.2, 3.0).longest_step == pytest.approx(2.0 * math.pi / 3.0 / 8.0)
    assert Impulse(0.5, 1.0, 5.0, 0.2).longest_step == 0.1
    assert Table([0.0], [0.0], [0.0]).longest_step == math.inf
    assert Table([0.0, 1.0, 1.25], [0.0] * 3, [0.0] * 3).longest_step == 0.25


@given(
    st.sampled_from(
        [
            Constant(0.5, -0.1),
            Sinusoid(0.08, 0.2, 0.5, 1.7),
            Impulse(0.5, 1.0, 5.0, 0.3),
            Table([0.1], [0.2], [0.3]),
            Table([-1.0, 0.0, 0.3, 2.0], [0.1, 0.7, 0.2, 0.0], [0.3, -0.4, 0.5, 1.0]),
        ]
    ),
    st.floats(-12.0, 12.0) | st.sampled_from([-1.0, 0.0, 0.1, 0.3, 2.0]),
)
@settings(deadline=None)
def test_compiled_code_drives_the_same_bits(program: LeaderProgram, t: float) -> None:
    numbers, rows = encoded(program)
    assert driven_at(numbers, rows, t) == interpreted(driven_at)(numbers, rows, t) == program(t)


def test_a_program_of_ones_own_is_not_for_compiled_code() -> None:
    class Waiting:
        period, longest_step = None, math.inf

        def __call__(self, t: float) -> Motion:
            return Motion(0.0, 0.0)

    with pytest.raises(ValueError, match="Waiting is no kind"):
        encoded(Waiting())
