"""A way put together from parts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.consistency.summed_way import mean_of_way, way_added
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import NO_MOTION

PARTS = st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.floats(0.01, 1.0)), min_size=1, max_size=20
)


@given(PARTS)
def test_parts_of_one_deviation_keep_it_and_their_motion_is_weighed_by_time(
    parts: list[tuple[float, float, float]],
) -> None:
    way, span = NO_MOTION, sum(dt for _, _, dt in parts)
    for v2, u2, dt in parts:
        way = way_added(way, FollowerMotion(v2, u2, 0.1, 0.3), dt)
    mean = mean_of_way(way, span)
    assert mean.v2 == pytest.approx(sum(v2 * dt for v2, _, dt in parts) / span, abs=1e-12)
    assert mean.u2 == pytest.approx(sum(u2 * dt for _, u2, dt in parts) / span, abs=1e-12)
    assert (mean.sd_v2, mean.sd_u2) == pytest.approx((0.1, 0.3))
