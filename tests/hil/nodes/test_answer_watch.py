"""A robot that does not answer its commands is told from one that does, and from one that is not asked."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from formation.pose import STANDSTILL, Motion
from hil.nodes.answer_watch import UNASKED, answer_findings, with_answer

BEGUN_NS = 1_700_000_000_000_000_000
REPORT_NS = 500_000_000

MOVES = st.builds(Motion, st.floats(0.03, 0.3), st.floats(-3.0, 3.0))


def found(told: list[tuple[Motion, Motion | None]], begun_ns: int = BEGUN_NS) -> list[bool]:
    """Whether there is a finding at each of the reports."""
    watch, seen = UNASKED, []
    for number, (asked, shown) in enumerate(told):
        now_ns = begun_ns + number * REPORT_NS
        watch = with_answer(watch, now_ns, asked, shown)
        seen.append("deaf_robot" in answer_findings(watch, now_ns))
    return seen


@given(st.lists(MOVES, min_size=4, max_size=20))
def test_a_robot_that_stands_is_found_after_a_second(asked: list[Motion]) -> None:
    seen = found([(motion, STANDSTILL) for motion in asked])
    assert seen == [False, False] + [True] * (len(asked) - 2)


@given(st.lists(MOVES, min_size=4, max_size=20), st.floats(0.05, 2.0))
def test_a_robot_that_answers_with_its_lag_is_not(asked: list[Motion], lag_s: float) -> None:
    """First-order, from standstill, each command for half a second; with noise of a mocap track at rest."""
    v = u = 0.0
    share = 1.0 - math.exp(-0.5 / lag_s)
    told: list[tuple[Motion, Motion | None]] = []
    for motion in asked:
        told.append((motion, Motion(v, u)))
        v, u = v + share * (abs(motion.v) + 0.03 - v), u + share * (motion.u - u)
    assert not any(found(told))


@given(st.lists(st.tuples(st.floats(-0.029, 0.029), st.floats(-0.19, 0.19)), max_size=20))
def test_who_is_hardly_told_to_move_may_stand(asked: list[tuple[float, float]]) -> None:
    assert not any(found([(Motion(v, u), STANDSTILL) for v, u in asked]))


@given(st.lists(MOVES, max_size=20))
def test_nothing_is_said_while_nobody_knows_how_the_robot_moves(asked: list[Motion]) -> None:
    assert not any(found([(motion, None) for motion in asked]))


def test_a_clock_that_is_set_back_begins_anew() -> None:
    asked = Motion(0.1, 0.0)
    watch = with_answer(UNASKED, BEGUN_NS, asked, STANDSTILL)
    watch = with_answer(watch, BEGUN_NS - 3600 * 10**9, asked, STANDSTILL)
    assert not answer_findings(watch, BEGUN_NS - 3600 * 10**9)
