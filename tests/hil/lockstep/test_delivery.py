"""What the order of delivery does to the estimates by noise that is given: nothing."""

from __future__ import annotations

import pytest

from benchmarks.delivery import FRONT_ENDS, SOURCES, compare


@pytest.mark.parametrize("front_end", FRONT_ENDS)
@pytest.mark.parametrize("source", SOURCES)
def test_shuffled_and_doubled_delivery_changes_nothing(source: str, front_end: str) -> None:
    found = compare(source, front_end, seed=5, seconds=0.6)
    assert found.quantities < 1e-9
    assert found.covariance < 1e-9
    assert found.late > 20
