from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from controllers.limits import Limits
from formation.pose import Motion

anything = st.floats(allow_nan=True, allow_infinity=True)
LIMITS = Limits(0.22, 2.84)


@given(st.builds(Motion, anything, anything))
@example(Motion(math.nan, 0.1))
@example(Motion(0.1, math.nan))
@example(Motion(math.inf, -math.inf))
@settings(deadline=None)
def test_result_is_within_limits_or_nan_where_nan_came_in(wanted: Motion) -> None:
    allowed, saturated = LIMITS.apply(wanted)
    for asked, given_, bound in ((wanted.v, allowed.v, 0.22), (wanted.u, allowed.u, 2.84)):
        if math.isnan(asked):
            assert math.isnan(given_)
        else:
            assert abs(given_) <= bound
            assert given_ == asked or abs(asked) > bound
            assert given_ == asked or math.copysign(1.0, given_) == math.copysign(1.0, asked)
    assert saturated == (abs(wanted.v) > 0.22 or abs(wanted.u) > 2.84)


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf])
def test_limits_without_sense_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="v_max"):
        Limits(bad, 1.0)
    with pytest.raises(ValueError, match="u_max"):
        Limits(1.0, bad)
