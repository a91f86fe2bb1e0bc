from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.adversary import drive_out
from formation.invariant_set import Disturbed, invariant_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange

TURTLEBOT3 = Disturbed(1.5, Spacing(0.2, 20.0), SpeedRange(0.08, 0.08), 0.7)


@pytest.mark.slow
@pytest.mark.parametrize("speeds", [(0.08, 0.08), (0.07, 0.09)])
def test_no_leader_drives_a_pair_out_of_its_set_but_some_come_to_the_edge(
    speeds: tuple[float, float],
) -> None:
    system = replace(TURTLEBOT3, speeds=SpeedRange(*speeds))
    found = invariant_set(system)
    assert found is not None
    came = drive_out(system, found, np.random.default_rng(1), pairs=500, duration=20.0)
    assert came.left == 0
    assert came.rho_max > found.rho_max - 2e-3
    assert came.rho_min < found.rho_min + 2e-3


def test_leaders_that_turn_harder_than_assumed_drive_pairs_out() -> None:
    found = invariant_set(TURTLEBOT3)
    assert found is not None
    harder = replace(TURTLEBOT3, D=0.75)
    assert drive_out(harder, found, np.random.default_rng(1), pairs=200, duration=10.0).left > 50
