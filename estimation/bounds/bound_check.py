"""All named bounds of an estimate, and the verdict on them where the truth is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimation.bounds.error_bounds import (
    InputErrors,
    Perceived,
    RateErrors,
    Values,
    paper_bounds,
    sound_and_extended_bounds,
)
from formation.angles import FloatArray, wrap
from formation.spacing import Spacing
from formation.station import ABREAST, Station

QUANTITY_OF = {
    "v1": "v1",
    "alpha1": "alpha1",
    "h": "h",
    "v1_extended": "v1",
    "alpha1_extended": "alpha1",
    "h_extended": "h",
    "paper_alpha1": "alpha1",
    "paper_h": "h",
}
"""Whose error each named bound of :func:`all_bounds` is about."""

ROUNDING = 256.0 * float(np.finfo(np.float64).eps)
"""What rounding alone can make of an error, in SI units: see :func:`check`."""


@dataclass(frozen=True, slots=True, eq=False)
class SpeedInputs:
    """What the speed law (8) looks at: rho [m], v1 [m/s], alpha1 [rad]; floats or arrays of shape (n,)."""

    rho: Values
    v1: Values
    alpha1: Values


@dataclass(frozen=True, slots=True)
class Verdict:
    """Per named bound: how often an error exceeded it, and the largest error / bound (0 for no samples)."""

    violations: dict[str, int]
    tightness: dict[str, float]


def all_bounds(
    perceived: Perceived,
    rates: RateErrors,
    inputs: InputErrors,
    *,
    v_eps: Values,
    mu1: float,
    spacing: Spacing,
    station: Station = ABREAST,
) -> dict[str, FloatArray]:
    """Every named bound for the same moment(s): the keys of ``bounds`` in the JSON of a run."""
    paper = paper_bounds(perceived, rates, v_eps, mu1, spacing)
    sound, extended = sound_and_extended_bounds(perceived, rates, inputs, v_eps, mu1, spacing, station)
    return {
        "v1": sound.v1,
        "alpha1": sound.alpha1,
        "h": sound.h,
        "v1_extended": extended.v1,
        "alpha1_extended": extended.alpha1,
        "h_extended": extended.h,
        "paper_alpha1": paper.alpha1,
        "paper_h": paper.h,
    }


def h_of(
    truth: SpeedInputs, believed: SpeedInputs, mu1: float, spacing: Spacing, station: Station = ABREAST
) -> FloatArray:
    """Second component of h [rad/s]: the alpha1 dynamics of (5) under law (8), without the leader's -u1.

    (v1 sin(alpha1) + v2_hat) / rho, where v2_hat is the speed that law (8) asks for on what is *believed* and
    all else is true, on the manifold alpha2 = pi/2. With belief equal to truth this is the nominal
    -mu1 cos(alpha1) + v1 f(rho). The h_tilde of the appendix is h_of(truth, believed) - h_of(truth, truth):
    the error of the asked speed over the distance. Off the manifold it enters alpha1 times sin(alpha2), so
    that its bound holds there too. At another station, on its own manifold, v2_hat counts with the sine of
    the bearing, by which its law divides.
    """
    return _h(truth, _across(truth), _asked_across(believed, _across(believed), mu1, spacing, station))


def errors_of(
    perceived: Perceived, truth: SpeedInputs, mu1: float, spacing: Spacing, station: Station = ABREAST
) -> dict[str, FloatArray]:
    """Actual magnitudes of the errors of v1 [m/s], alpha1 [rad, at most pi] and h [rad/s]."""
    believed, across = SpeedInputs(perceived.rho, perceived.v1, perceived.alpha1), _across(truth)
    # Both of :func:`h_of`, whose sines take most of the time.
    asked = _asked_across(believed, _across(believed), mu1, spacing, station)
    rightly = _asked_across(truth, across, mu1, spacing, station)
    return {
        "v1": np.abs(np.asarray(truth.v1) - believed.v1),
        "alpha1": np.abs(wrap(np.asarray(truth.alpha1) - believed.alpha1)),
        "h": np.abs(_h(truth, across, asked) - _h(truth, across, rightly)),
    }


def check(errors: Mapping[str, Values], bounds: Mapping[str, Values]) -> Verdict:
    """Compare the errors of :func:`errors_of` with bounds by name.

    An error violates its bound when it is larger by more than :data:`ROUNDING`; what cannot be compared
    (NaN) counts as a violation. The tolerance is for errors that lie on their bound exactly, as the worst
    rate error of a run does: v1, alpha1 and h are differences of numbers of up to some tens in SI units, each
    from a dozen operations that add half a unit in the last place. 256 units in the last place of 1, 6e-14,
    are above that sum, and some nine orders of magnitude below what any sensor here resolves. Raises
    :class:`KeyError` for a bound that has no name in :data:`QUANTITY_OF`.
    """
    violations: dict[str, int] = {}
    tightness: dict[str, float] = {}
    for name, bound in bounds.items():
        error, limit = np.asarray(errors[QUANTITY_OF[name]]), np.asarray(bound)
        if error.shape != limit.shape:
            error, limit = np.broadcast_arrays(error, limit)
        violations[name] = error.size - int(np.count_nonzero(error <= limit + ROUNDING))
        tightness[name] = _tightness(error, limit)
    return Verdict(violations, tightness)


def _tightness(error: FloatArray, limit: FloatArray) -> float:
    """Largest error over its bound.

    Where bound and error are zero up to rounding there is nothing to be tight about.
    """
    counted, positive = error > ROUNDING, limit > 0.0
    if not positive.all():
        ratio = np.divide(error, limit, out=np.full(error.shape, np.inf), where=positive)
    else:
        ratio = error / limit
    return float((ratio if counted.all() else ratio[counted]).max(initial=0.0))


def _h(truth: SpeedInputs, across: FloatArray, asked: FloatArray) -> FloatArray:
    """See :func:`h_of`; by the parts across the line of the leader's velocity and of what is asked for."""
    h: FloatArray = (across + asked) / np.asarray(truth.rho)
    return h


def _across(seen: SpeedInputs) -> FloatArray:
    """Part of the leader's velocity across the line [m/s]."""
    across: FloatArray = np.asarray(seen.v1) * np.sin(seen.alpha1)
    return across


def _asked_across(
    seen: SpeedInputs, across: FloatArray, mu1: float, spacing: Spacing, station: Station
) -> FloatArray:
    """Part across the line [m/s] of the follower speed that Eq. (8) of the paper asks for: v2 sin(alpha2).

    ``across``: the same part of the leader's velocity.
    """
    rho, v1 = np.asarray(seen.rho), np.asarray(seen.v1)
    off = np.cos(seen.alpha1 + station.to_abreast)
    asked: FloatArray = rho * (-mu1 * off + station.sign * v1 * spacing.f(rho)) - across
    return asked
