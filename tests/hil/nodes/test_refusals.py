from __future__ import annotations

import pytest

from estimation.tracking.follower_check import Cause as FollowerCause
from estimation.tracking.track_point import Verdict
from hil.nodes import refusals
from hil.nodes.refusals import COUNTED, REFUSALS, TAKEN, refusal_of
from hil.wire.message_checks import Cause


@pytest.mark.parametrize("verdict", Verdict)
def test_without_a_known_cause_a_measurement_is_counted_by_its_verdict(verdict: Verdict) -> None:
    assert REFUSALS[refusal_of(verdict.value, FollowerCause.NONE.value)] == verdict.word


@pytest.mark.parametrize("cause", [cause for cause in FollowerCause if cause is not FollowerCause.NONE])
def test_a_cause_that_is_known_is_what_a_measurement_is_counted_by(cause: FollowerCause) -> None:
    assert REFUSALS[refusal_of(Verdict.GATED.value, cause.value)] == cause.word


def test_each_number_stands_for_its_word() -> None:
    named = {
        "CLOCK_UNKNOWN": "clock_unknown",
        "CLOCK_JUMP": "clock_jump",
        "SAME_PLACE": "same_place",
        "NO_BODY_FRONT_END": "sighting_without_body_front_end",
    }
    for name, word in named.items():
        assert REFUSALS[getattr(refusals, name)] == word
    for cause in Cause:
        assert REFUSALS[cause.value] == cause.word


def test_what_is_taken_is_counted_apart_from_what_is_refused() -> None:
    numbers = [refusals.TAKEN_FRAME, refusals.TAKEN_USED, refusals.TAKEN_ODOMETRY, refusals.TAKEN_LATE]
    assert numbers == [len(REFUSALS) + k for k in range(len(TAKEN))]
    assert max(numbers) == COUNTED - 1
