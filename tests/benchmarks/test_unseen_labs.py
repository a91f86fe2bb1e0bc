from __future__ import annotations

import numpy as np
import pytest

from benchmarks.unseen_labs import PROGRAMS, QUANTITIES, drawn, seen

LAB = drawn(np.random.default_rng(3))._replace(
    k_v=0.5, k_u=1.0, rate=60.0, sigma=5e-4, off=1.0, lost=0.02, lag=0.1, wheels=0.01
)


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("program", PROGRAMS)
def test_estimates_in_an_ordinary_lab_are_as_wrong_as_they_say(program: str, beside: bool) -> None:
    """Of whatever leader: tracked, none far beyond its deviation, errors at most half larger than told."""
    found = seen(LAB._replace(program=program, beside=beside), 1, duration=12.0)
    assert found.tracked > 0.85
    assert found.nees.shape == (len(QUANTITIES),)
    assert np.all(found.nees < 2.25)
    assert np.all(found.beyond < 0.02)


def test_a_lab_is_drawn_by_its_number_alone() -> None:
    first, again = (drawn(np.random.default_rng([1, 5])) for _ in range(2))
    assert first == again != drawn(np.random.default_rng([1, 6]))
