from __future__ import annotations

import pytest

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.consistency.noise_estimate import NOISE_AS_TOLD, NoiseScale, kept_noise
from estimation.consistency.process_estimate import NOTHING_LEARNED
from estimation.own_motion.odometry_check import UNCHECKED
from estimation.own_motion.odometry_history import Correction
from formation.records import load, store
from formation.ring import EMPTY, Ring
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_desk import NOTHING_KNOWN, Desk, forget, forget_tracks, noted
from hil.nodes.estimator_memory import EstimatorMemory
from hil.nodes.estimator_records import Known, Memory
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
    assert all(
        a is b
        for a, b in zip(found, (desk.points, desk.history, desk.own, desk.ways, desk.bank), strict=True)
    )
    assert Memory._fields == ("points", "history", "own", "ways", "bank")


LEARNED = NOISE_AS_TOLD._replace(scale=NoiseScale(2.0, 3.0, 4.0, 5.0), gated=True)


PROCESS = NOTHING_LEARNED._replace(speed=0.5, turn=2.0)


def filled(desk: Desk) -> Known:
    check = UNCHECKED._replace(heard=True, resets=1)
    known = NOTHING_KNOWN._replace(
        track=Ring(1, 2),
        odometry=Ring(3, 4),
        own=Ring(5, 6),
        correction=Correction(0.01, 0.1, 0.2),
        odometry_check=check,
        watched_ns=7,
        noise=LEARNED,
        process=PROCESS,
    )
    store(desk.known, 0, known)
    return known


def test_without_tracks_odometry_and_its_correction_stay_known() -> None:
    desk = memory().desk
    known = filled(desk)
    forget_tracks(desk)
    kept = known._replace(track=EMPTY, own=EMPTY, noise=kept_noise(LEARNED))
    assert load(Known, desk.known, 0) == kept
    assert kept.noise.scale == LEARNED.scale


def test_what_is_forgotten_is_all_as_at_the_begin() -> None:
    desk = memory().desk
    assert load(Known, desk.known, 0) == NOTHING_KNOWN
    filled(desk)
    forget(desk)
    assert load(Known, desk.known, 0) == NOTHING_KNOWN
