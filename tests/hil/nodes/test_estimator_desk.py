from __future__ import annotations

import pytest

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.own_motion.odometry_history import Correction
from estimation.tracking.mount_check import NO_MOUNT_CHECK
from formation.records import load, store
from formation.ring import EMPTY, Ring
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import NOTHING_KNOWN, Desk, forget, forget_tracks, noted
from hil.nodes.estimator_memory import EstimatorMemory
from hil.nodes.estimator_step import Known, Memory
from hil.scenario.files import load_scenario

NOW_NS = 1_000_000_000_000
NODE = EstimatorNode(load_scenario("turtlebot3"))


def memory() -> EstimatorMemory:
    return NODE.begin(NOW_NS).memory


@pytest.mark.parametrize(
    ("back_ns", "in_order"), [(-1, True), (CLOCK_TOLERANCE_NS, True), (CLOCK_TOLERANCE_NS + 1, False)]
)
def test_a_clock_that_is_set_back_further_than_clocks_differ_is_noticed_once(
    back_ns: int, in_order: bool
) -> None:
    kept, now_ns = memory(), NOW_NS - back_ns
    assert noted(kept.desk, 11, NOW_NS)
    assert noted(kept.desk, 12, now_ns) is in_order
    assert noted(kept.desk, 13, now_ns)
    assert [tuple(each) for each in kept.receipts] == [(11, NOW_NS), (12, now_ns), (13, now_ns)]


def test_at_the_begin_nothing_is_noted() -> None:
    notes = memory().notes
    assert not notes.times.clock.begun
    assert notes[1:] == (0, 0, 0, 0, 0, False)


def test_tracks_and_odometry_lie_where_they_are_named() -> None:
    desk = memory().desk
    found = desk.memory()
    assert all(a is b for a, b in zip(found, (desk.points, desk.history, desk.own), strict=True))
    assert Memory._fields == ("points", "history", "own")


def filled(desk: Desk) -> Known:
    known = Known(Ring(1, 2), Ring(3, 4), Ring(5, 6), Correction(0.01, 0.1, 0.2), NO_MOUNT_CHECK)
    store(desk.known, 0, known)
    return known


def test_without_tracks_odometry_and_its_correction_stay_known() -> None:
    desk = memory().desk
    known = filled(desk)
    forget_tracks(desk)
    assert load(Known, desk.known, 0) == known._replace(track=EMPTY, own=EMPTY)


def test_what_is_forgotten_is_all_as_at_the_begin() -> None:
    desk = memory().desk
    assert load(Known, desk.known, 0) == NOTHING_KNOWN
    filled(desk)
    forget(desk)
    assert load(Known, desk.known, 0) == NOTHING_KNOWN
