from __future__ import annotations

from itertools import product

import pytest

from estimation.tracking.follower_check import Cause
from estimation.tracking.tracker import Status
from hil.nodes.status_reasons import ALL_REASONS, reason_for, reason_number


def test_each_number_stands_for_the_reason_of_its_status_and_cause() -> None:
    numbers = [reason_number(status.value, cause.value) for status, cause in product(Status, Cause)]
    assert numbers == list(range(len(ALL_REASONS)))
    for status, cause in product(Status, Cause):
        assert ALL_REASONS[reason_number(status.value, cause.value)] == reason_for(status, cause)


@pytest.mark.parametrize("status", Status)
def test_only_who_tracks_has_no_reason_and_only_who_rejects_one_by_its_cause(status: Status) -> None:
    reasons = {reason_for(status, cause) for cause in Cause}
    assert (reasons == {""}) is (status is Status.TRACKING)
    # Without a cause, and outside the gate of the leader, it is the gate.
    assert len(reasons) == (len(Cause) - 1 if status is Status.REJECTING else 1)


def test_words_for_rejected_measurements_say_what_was_wrong() -> None:
    assert "gate" in reason_for(Status.REJECTING, Cause.NONE)
    assert "gate" in reason_for(Status.REJECTING, Cause.GATED)
    assert "turned round" in reason_for(Status.REJECTING, Cause.FLIPPED)
    assert "repeated" in reason_for(Status.REJECTING, Cause.FROZEN)
