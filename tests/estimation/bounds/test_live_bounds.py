"""The extended bounds of a moment, against the formulas of ``extended_h`` on arrays, written apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.entries import bound_all
from estimation.bounds.error_bounds import InputErrors, Perceived, RateErrors, extended_bounds
from estimation.bounds.live_bounds import ErrorBounds, LawConstants, Moment, MomentBounds, bounds_at
from formation.angles import FloatArray, wrap
from formation.kernel import interpreted
from formation.records import row_of
from formation.spacing import Spacing
from formation.station import Side, Station

SPACING = Spacing(0.2, 20.0)
V_EPS, MU1 = 0.04, 1.5

angles = st.floats(-math.pi, math.pi)
speeds = st.floats(-1.0, 1.0)
sizes = st.floats(0.0, 0.5)
moments = st.builds(Moment, st.floats(0.01, 5.0), angles, speeds, st.floats(0.0, 1.0), angles, speeds, speeds)
error_bounds = st.builds(ErrorBounds, sizes, sizes, sizes, st.floats(0.0, 4.0), sizes, sizes)
stations = st.builds(Station, st.sampled_from(Side), st.floats(0.5, 2.5))
trials = st.lists(st.tuples(moments, error_bounds), min_size=1, max_size=5)


def written_apart(table: FloatArray, station: Station) -> FloatArray:
    """Bounds (3, n) of moments (n, 7) with their errors (n, 6)."""
    rho, alpha2, alpha2_dot, v1, alpha1, v2, u2, *errors = table.T
    M_rho, M_alpha2, E_rho, E_alpha2, E_v2, E_u2 = errors
    turn, turn_error, speed = np.abs(alpha2_dot + u2), M_alpha2 + E_u2, np.abs(v2)
    chord = 2.0 * np.sin(0.5 * np.minimum(E_alpha2, math.pi)) * np.sqrt(speed * (speed + E_v2))
    motion = np.hypot(E_v2, chord)
    bound_v1 = np.hypot(M_rho, E_rho * (turn + turn_error) + rho * turn_error) + motion
    longest = np.maximum(v1, V_EPS)
    bound_alpha1 = np.where(bound_v1 < longest, np.arcsin(np.minimum(bound_v1 / longest, 1.0)), math.pi)
    known = rho > E_rho
    lo = np.where(known, rho - E_rho, rho)
    stretch, off = E_rho / lo, alpha1 + station.to_abreast
    f_lo, f_hat, f_hi = (20.0 * (1.0 - (0.2 / r) ** 2) for r in (lo, rho, rho + E_rho))
    aside = changed(alpha2 - 0.5 * math.pi, np.minimum(E_alpha2, math.pi))
    line = turn_error + stretch * turn + np.minimum(E_v2 + speed * aside, motion) / lo
    bearing = MU1 * (changed(off, bound_alpha1) + stretch * np.abs(np.cos(off)))
    distance = bound_v1 * np.maximum(np.abs(f_lo), np.abs(f_hi))
    distance += v1 * (np.maximum(f_hat - f_lo, f_hi - f_hat) + stretch * np.abs(f_hat))
    return np.stack([bound_v1, bound_alpha1, np.where(known, line + bearing + distance, math.inf)])


def changed(angle: FloatArray, span: FloatArray) -> FloatArray:
    """Largest change of the cosine within a span, by its ends and its extremes at 0 and pi."""
    folded = np.abs(wrap(angle))
    ends = np.stack([np.maximum(folded - span, 0.0), np.minimum(folded + span, math.pi)])
    largest: FloatArray = np.max(np.abs(np.cos(ends) - np.cos(folded)), axis=0)
    return largest


@given(trials, stations)
def test_bounds_are_those_of_the_formulas(given_: list[tuple[Moment, ErrorBounds]], station: Station) -> None:
    law = LawConstants.of(V_EPS, MU1, SPACING, station)
    expected = written_apart(np.array([[*seen, *errors] for seen, errors in given_]), station)
    for k, (seen, errors) in enumerate(given_):
        found = bounds_at(seen, errors, law)
        assert found.v1 == pytest.approx(expected[0, k], rel=1e-12)
        # Where the disc all but reaches the origin the arcsine loses half of the digits.
        assert found.alpha1 == pytest.approx(expected[1, k], rel=1e-6)
        assert found.h == pytest.approx(expected[2, k], rel=1e-6)


@given(trials, stations)
def test_arrays_are_bounded_moment_by_moment_compiled_or_not(
    given_: list[tuple[Moment, ErrorBounds]], station: Station
) -> None:
    law = LawConstants.of(V_EPS, MU1, SPACING, station)
    table = np.array([[*seen, V_EPS, *errors, *reversed(errors)] for seen, errors in given_]).T.copy()
    compiled, plain = np.empty((6, len(given_))), np.empty((6, len(given_)))
    bound_all(table, row_of(law._replace(v_eps=7.0)), compiled)
    interpreted(bound_all)(table, row_of(law), plain)
    assert compiled.tobytes() == plain.tobytes()
    for first, sets in ((0, [errors for _, errors in given_]), (3, [errors[::-1] for _, errors in given_])):
        assert [MomentBounds(*column) for column in plain[first : first + 3].T.tolist()] == [
            bounds_at(seen, ErrorBounds(*errors), law) for (seen, _), errors in zip(given_, sets, strict=True)
        ]


@pytest.mark.parametrize("shape", [(), (1,), (4,), (2, 3)])
def test_floats_and_arrays_of_any_shape_are_spread_over_each_other(shape: tuple[int, ...]) -> None:
    rho = np.full(shape, 0.3)
    seen = Perceived(rho, 1.5, 0.0, 0.1, 0.08, -1.5, 0.08, 0.1)
    found = extended_bounds(seen, RateErrors(0.01, 0.02), InputErrors(0.01), V_EPS, MU1, SPACING)
    law = LawConstants.of(V_EPS, MU1, SPACING)
    moment = Moment(0.3, 1.5, 0.1, 0.08, -1.5, 0.08, 0.1)
    expected = bounds_at(moment, ErrorBounds(0.01, 0.02, 0.01, 0.0, 0.0, 0.0), law)
    for bound, one in zip(found, expected, strict=True):
        assert np.shape(bound) == shape
        assert np.all(bound == one)
