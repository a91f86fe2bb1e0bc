from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Pose
from formation.shape import shape_of
from hil.live_page.believed_leader import AHEAD_S, DEVIATIONS, believed_pose, motion_ellipse

PLACE = st.floats(-5.0, 5.0)
ANGLE = st.floats(-3.1, 3.1)


@given(PLACE, PLACE, ANGLE, st.floats(0.1, 3.0), ANGLE, ANGLE)
def test_the_believed_leader_is_the_one_of_that_shape(
    x: float, y: float, theta: float, rho: float, alpha1: float, alpha2: float
) -> None:
    follower = Pose(x, y, theta)
    shape = shape_of(believed_pose(follower, rho, alpha1, alpha2), follower)
    assert shape.rho == pytest.approx(rho)
    for found, wanted in ((shape.alpha1, alpha1), (shape.alpha2, alpha2)):
        assert math.remainder(found - wanted, math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("v1", "theta"), [(0.08, 0.3), (0.5, -2.0)])
def test_the_ellipse_has_the_spread_of_where_leaders_of_that_belief_come_to(v1: float, theta: float) -> None:
    covariance = np.array([[4e-6, -1.5e-5], [-1.5e-5, 4e-4]])
    draws = np.random.default_rng(1).multivariate_normal([v1, 0.7], covariance, size=200_000)
    heading = theta - (draws[:, 1] - 0.7)
    places = AHEAD_S * draws[:, :1] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    values, vectors = np.linalg.eigh(np.cov(places.T))
    ellipse = motion_ellipse(theta, v1, covariance[0, 0], covariance[0, 1], covariance[1, 1])
    assert ellipse is not None
    spread = DEVIATIONS * np.sqrt(values)
    assert [ellipse.minor, ellipse.major] == pytest.approx(list(spread), rel=0.02)
    along = vectors[:, 1] @ [math.cos(ellipse.angle), math.sin(ellipse.angle)]
    assert abs(along) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("values", [(math.nan, 0.0, 1.0), (1.0, math.inf, 1.0), (-1.0, 0.0, 1.0)])
def test_what_is_no_covariance_has_no_ellipse(values: tuple[float, float, float]) -> None:
    assert motion_ellipse(0.0, 0.1, *values) is None
