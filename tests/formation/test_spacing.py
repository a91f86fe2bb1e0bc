from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape
from formation.spacing import Spacing, lyapunov
from formation.station import Side, Station

spacings = st.builds(Spacing, st.floats(0.1, 2), st.floats(0.1, 30))
distances = st.floats(0.05, 10)


@given(spacings, distances)
@settings(deadline=None, max_examples=50)
def test_g_is_the_integral_of_f(spacing: Spacing, rho: float) -> None:
    area, error = quad(spacing.f, spacing.rho_0, rho)
    assert spacing.g(rho) == pytest.approx(area, rel=1e-9, abs=10 * error + 1e-12)


@given(spacings, distances)
@settings(deadline=None)
def test_f_is_the_papers_and_f_prime_its_slope(spacing: Spacing, rho: float) -> None:
    as_printed = spacing.mu_rho * (rho**2 - spacing.rho_0**2) / rho**2
    assert spacing.f(rho) == pytest.approx(as_printed, rel=1e-9, abs=1e-12 * spacing.mu_rho)
    assert spacing.f(rho) < spacing.mu_rho
    h = 1e-4 * rho
    slope = (spacing.f(rho + h) - spacing.f(rho - h)) / (2 * h)
    assert spacing.f_prime(rho) == pytest.approx(slope, rel=1e-6)


@given(spacings, distances)
@settings(deadline=None)
def test_g_is_positive_but_at_rho_0(spacing: Spacing, rho: float) -> None:
    assert spacing.g(spacing.rho_0) == 0.0 == spacing.f(spacing.rho_0)
    assert rho == spacing.rho_0 or spacing.g(rho) > 0.0


def test_arrays_and_floats_agree() -> None:
    spacing, rho = Spacing(0.2, 20.0), np.geomspace(0.01, 10.0, 50)
    for function in (spacing.f, spacing.g, spacing.f_prime):
        np.testing.assert_array_equal(function(rho), [function(float(value)) for value in rho])


@pytest.mark.parametrize("bad", [0.0, -0.2, math.nan, math.inf])
def test_constants_without_sense_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="rho_0"):
        Spacing(bad, 1.0)
    with pytest.raises(ValueError, match="mu_rho"):
        Spacing(1.0, bad)


def test_lyapunov_function_vanishes_abreast_and_has_the_papers_start_outside() -> None:
    spacing = Spacing(0.5, 2.0)
    assert lyapunov(Shape(0.5, ABREAST_ALPHA1, ABREAST_ALPHA2), spacing) == 0.0
    assert lyapunov(Shape(1.0, math.pi / 4, math.pi / 2), spacing) == pytest.approx(2.2071, abs=5e-5)


@given(spacings, distances)
def test_a_pull_has_its_distance(spacing: Spacing, rho: float) -> None:
    assert spacing.distance(spacing.f(rho)) == pytest.approx(rho, rel=1e-6)
    assert spacing.distance(0.0) == spacing.rho_0


@given(spacings, distances, st.sampled_from(Side), st.floats(0.1, 3.0), st.floats(-3.1, 3.1))
def test_at_any_station_it_weighs_the_angle_off_it_and_the_distance(
    spacing: Spacing, rho: float, side: Side, bearing: float, off: float
) -> None:
    station = Station(side, bearing)
    shape = Shape(rho, station.alpha1 + off, station.alpha2)
    expected = 1.0 - math.cos(off) + math.sin(bearing) * spacing.g(rho)
    assert lyapunov(shape, spacing, station) == pytest.approx(expected, rel=1e-9, abs=1e-9)
