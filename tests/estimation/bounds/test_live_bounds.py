"""The bounds of a live estimate are those of the vectorised form, moment by moment."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.error_bounds import (
    InputErrors,
    Perceived,
    RateErrors,
    extended_alpha1,
    extended_h,
    extended_v1,
)
from estimation.bounds.live_bounds import ErrorBounds, LawConstants, live_bounds
from formation.spacing import Spacing
from formation.station import Side, Station

angles = st.floats(-math.pi, math.pi)
speeds = st.floats(-1.0, 1.0)
errors = st.floats(0.0, 0.5)


@given(
    shape=st.tuples(st.floats(0.01, 5.0), angles),
    leader=st.tuples(st.floats(0.0, 1.0), angles),
    follower=st.tuples(speeds, speeds),
    alpha2_dot=speeds,
    bounds=st.tuples(errors, errors, errors, st.floats(0.0, 4.0), errors, errors),
    station=st.builds(Station, st.sampled_from(Side), st.floats(0.5, 2.5)),
)
def test_equals_the_vectorised_bounds(
    shape: tuple[float, float],
    leader: tuple[float, float],
    follower: tuple[float, float],
    alpha2_dot: float,
    bounds: tuple[float, float, float, float, float, float],
    station: Station,
) -> None:
    law = LawConstants(0.04, 1.5, Spacing(0.2, 20.0), station)
    live = live_bounds(shape, leader, follower, alpha2_dot, ErrorBounds(*bounds), law)
    seen = Perceived(*shape, 0.0, alpha2_dot, *leader, *follower)
    rates, inputs = RateErrors(*bounds[:2]), InputErrors(*bounds[2:])
    assert live[0] == pytest.approx(float(extended_v1(seen, rates, inputs)), rel=1e-12)
    assert live[1] == pytest.approx(float(extended_alpha1(seen, rates, inputs, 0.04)), rel=1e-6)
    bound_h = extended_h(seen, rates, inputs, 0.04, 1.5, law.spacing, station)
    assert live[2] == pytest.approx(float(bound_h), rel=1e-6)
