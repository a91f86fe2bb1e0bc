"""How wrong the leader's estimate can be: the bounds of the paper's appendix in three named forms.

``paper`` is the appendix as printed, ``sound`` is what can be proved under its assumptions, ``extended`` also
admits errors of the follower's own quantities (rho, alpha2, v2, u2), which every real sensor has.

All three speak of the estimate built as in the appendix: with X = -rho_dot - v2 cos(alpha2) and
Y = rho (alpha2_dot + u2) - v2 sin(alpha2), the leader's velocity (X, Y) is v1 (cos(alpha1), sin(alpha1)), and
the believed v1 and alpha1 are the polar coordinates of the believed (X, Y). The error of h is the one of
:func:`estimation.bounds.bound_check.h_of`, for the law at a station. Below, a hat marks what is believed and
no hat the truth. Every function takes floats or arrays of shape (n,), and no bound shrinks when an error
grows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimation.bounds.live_bounds import LawConstants, Moment
from formation.angles import FloatArray
from formation.records import row_of
from formation.spacing import Spacing
from formation.station import ABREAST, Station

Values = float | FloatArray

_NO_LAW = LawConstants(0.0, 0.0, 1.0, 1.0, 0.0)
"""For bounds that no law enters."""


@dataclass(frozen=True, slots=True, eq=False)
class RateErrors:
    """Bounds of the rate errors: |rho_dot error| <= M_rho [m/s], |alpha2_dot error| <= M_alpha2 [rad/s].

    Raises :class:`ValueError` unless all are finite and >= 0.
    """

    M_rho: Values
    M_alpha2: Values

    def __post_init__(self) -> None:
        _require_magnitudes(M_rho=self.M_rho, M_alpha2=self.M_alpha2)


@dataclass(frozen=True, slots=True, eq=False)
class InputErrors:
    """Bounds of the errors of what the follower knows of itself; all zero in the paper's appendix.

    E_rho [m], E_alpha2 [rad], E_v2 [m/s], E_u2 [rad/s]. Raises :class:`ValueError` unless finite and >= 0.
    """

    E_rho: Values = 0.0
    E_alpha2: Values = 0.0
    E_v2: Values = 0.0
    E_u2: Values = 0.0

    def __post_init__(self) -> None:
        _require_magnitudes(E_rho=self.E_rho, E_alpha2=self.E_alpha2, E_v2=self.E_v2, E_u2=self.E_u2)


@dataclass(frozen=True, slots=True, eq=False)
class Perceived:
    """What the follower believes at one moment: the hat quantities, each a float or an array of shape (n,).

    rho [m], alpha2 [rad] and their rates [m/s], [rad/s]; leader speed v1 [m/s] and bearing alpha1 [rad]; its
    own measured motion v2 [m/s], u2 [rad/s] at the time of the measurement (never a command).
    """

    rho: Values
    alpha2: Values
    rho_dot: Values
    alpha2_dot: Values
    v1: Values
    alpha1: Values
    v2: Values
    u2: Values

    @staticmethod
    def from_rates(
        rho: Values, alpha2: Values, rho_dot: Values, alpha2_dot: Values, v2: Values, u2: Values
    ) -> Perceived:
        """Build v1 and alpha1 from the rates, as the appendix does (with atan2 in the place of arctan)."""
        x = -rho_dot - v2 * np.cos(alpha2)
        y = rho * (alpha2_dot + u2) - v2 * np.sin(alpha2)
        return Perceived(rho, alpha2, rho_dot, alpha2_dot, np.hypot(x, y), np.arctan2(y, x), v2, u2)


class Bounds(NamedTuple):
    """Bounds of the errors of v1 [m/s], alpha1 [rad] and h [rad/s], in one of the forms."""

    v1: FloatArray
    alpha1: FloatArray
    h: FloatArray


def sound_v1(perceived: Perceived, rates: RateErrors) -> FloatArray:
    """M = sqrt(M_rho^2 + rho^2 M_alpha2^2) [m/s], in the paper's form and in the sound form alike.

    With exact rho, alpha2, v2, u2 the errors of X and Y are those of rho_dot and rho alpha2_dot, so that
    |(X, Y) - (X_hat, Y_hat)| <= M; lengths of vectors differ by no more than the vectors do.
    """
    bound: FloatArray = np.hypot(rates.M_rho, perceived.rho * np.asarray(rates.M_alpha2))
    return bound


def extended_v1(perceived: Perceived, rates: RateErrors, inputs: InputErrors) -> FloatArray:
    """M_XY [m/s], which takes the place of M when rho, alpha2, v2, u2 carry errors too.

    (X, Y) = (-rho_dot, rho a) - v2 (cos(alpha2), sin(alpha2)) with a = alpha2_dot + u2. The first part errs
    by M_rho and, as rho a - rho_hat a_hat = (rho - rho_hat) a + rho_hat (a - a_hat), by
    m_Y = E_rho (|a_hat| + M_alpha2 + E_u2) + rho_hat (M_alpha2 + E_u2); the second by
    :func:`~.live_bounds.motion_error`.
    """
    return _bounds(perceived, rates, (inputs,), 0.0, _NO_LAW)[0].v1


def paper_alpha1(perceived: Perceived, rates: RateErrors, v_eps: Values) -> FloatArray:
    """M / v_eps [rad]: the appendix as printed, the first term of a Taylor series. Not a bound.

    It falls short of :func:`sound_alpha1` where v1_hat is close to v_eps; v_eps = 0 gives infinity.
    """
    return _paper_alpha1(sound_v1(perceived, rates), v_eps)


def _paper_alpha1(M: FloatArray, v_eps: Values) -> FloatArray:
    if isinstance(v_eps, float) and v_eps > 0.0:
        return M / v_eps
    velocity_error, floor = np.broadcast_arrays(M, np.asarray(v_eps))
    bound: FloatArray = np.divide(
        velocity_error, floor, out=np.full(floor.shape, math.inf), where=floor > 0.0
    )
    return bound


def sound_alpha1(perceived: Perceived, rates: RateErrors, v_eps: Values) -> FloatArray:
    """Bound A = arcsin(M / max(v1_hat, v_eps)) [rad] where M is smaller than that maximum, else pi.

    The true velocity lies in a disc of radius M around the believed one. Seen from the origin, at a distance
    v1_hat > M from its centre, this disc subtends arcsin(M / v1_hat) to each side. The believed velocity lies
    as well in a disc around the true one, whose distance from the origin is v1 >= v_eps, and so
    arcsin(M / v_eps) holds too. If M reaches both, any direction is possible.
    """
    return extended_alpha1(perceived, rates, InputErrors(), v_eps)


def extended_alpha1(
    perceived: Perceived, rates: RateErrors, inputs: InputErrors, v_eps: Values
) -> FloatArray:
    """:func:`sound_alpha1` with M_XY of :func:`extended_v1` in the place of M [rad]."""
    return _bounds(perceived, rates, (inputs,), v_eps, _NO_LAW)[0].alpha1


def paper_h(perceived: Perceived, rates: RateErrors, mu1: float, spacing: Spacing) -> FloatArray:
    """M_alpha2 + mu1 + f(rho) M [rad/s]: the appendix as printed. Not a bound.

    The difference of two cosines can reach 2, not 1, and f is negative for rho < rho_0.
    """
    return _paper_h(sound_v1(perceived, rates), perceived, rates, mu1, spacing)


def _paper_h(
    M: FloatArray, perceived: Perceived, rates: RateErrors, mu1: float, spacing: Spacing
) -> FloatArray:
    bound: FloatArray = rates.M_alpha2 + mu1 + spacing.f(np.asarray(perceived.rho)) * M
    return bound


def paper_bounds(
    perceived: Perceived, rates: RateErrors, v_eps: Values, mu1: float, spacing: Spacing
) -> Bounds:
    """:func:`sound_v1`, which is the paper's too, :func:`paper_alpha1` and :func:`paper_h` at once."""
    M = sound_v1(perceived, rates)
    return Bounds(M, _paper_alpha1(M, v_eps), _paper_h(M, perceived, rates, mu1, spacing))


def sound_h(
    perceived: Perceived,
    rates: RateErrors,
    v_eps: Values,
    mu1: float,
    spacing: Spacing,
    station: Station = ABREAST,
) -> FloatArray:
    """M_alpha2 + mu1 dev + |f(rho)| M [rad/s], dev the largest change of cos(alpha1) within A.

    Law (8) put into the alpha1 dynamics of (5) leaves h_hat - h = (Y - Y_hat)/rho
    - mu1 (cos(alpha1_hat) - cos(alpha1)) + (v1_hat - v1) f(rho), whose first term is the error of alpha2_dot.
    At another station the law has the sine of the angle by which alpha1 is off in the place of cos(alpha1),
    and f has the sign of the side.
    """
    return extended_h(perceived, rates, InputErrors(), v_eps, mu1, spacing, station)


def extended_h(
    perceived: Perceived,
    rates: RateErrors,
    inputs: InputErrors,
    v_eps: Values,
    mu1: float,
    spacing: Spacing,
    station: Station = ABREAST,
) -> FloatArray:
    """Bound of h_hat - h [rad/s] when rho, alpha2, v2, u2 carry errors too; infinite for E_rho >= rho_hat.

    The law runs on rho_hat while the dynamics divide by rho, with rho in [lo, hi] = rho_hat -+ E_rho. Let
    s = E_rho / lo, the most by which rho_hat/rho and 1 can differ, and a = alpha2_dot + u2. Then h_hat - h is
    the sum of three parts:

    * (Y - Y_hat)/rho = a - a_hat + a_hat (rho - rho_hat)/rho - (v2 sin(alpha2) - v2_hat sin(alpha2_hat))/rho,
      at most M_alpha2 + E_u2 + s |a_hat| + (error of v2 sin(alpha2))/lo;
    * mu1 (cos(alpha1) - cos(alpha1_hat) rho_hat/rho), at most mu1 (dev + s |cos(alpha1_hat)|);
    * v1_hat f(rho_hat) rho_hat/rho - v1 f(rho) = (v1_hat - v1) f(rho) + v1_hat (f(rho_hat) - f(rho))
      + v1_hat f(rho_hat) (rho_hat/rho - 1), where f is largest and changes most at lo or hi because it grows.
    """
    return extended_bounds(perceived, rates, inputs, v_eps, mu1, spacing, station).h


def extended_bounds(
    perceived: Perceived,
    rates: RateErrors,
    inputs: InputErrors,
    v_eps: Values,
    mu1: float,
    spacing: Spacing,
    station: Station = ABREAST,
) -> Bounds:
    """:func:`extended_v1`, :func:`extended_alpha1` and :func:`extended_h` at once."""
    law = LawConstants.of(0.0, mu1, spacing, station)
    return _bounds(perceived, rates, (inputs,), v_eps, law)[0]


def sound_and_extended_bounds(
    perceived: Perceived,
    rates: RateErrors,
    inputs: InputErrors,
    v_eps: Values,
    mu1: float,
    spacing: Spacing,
    station: Station = ABREAST,
) -> tuple[Bounds, Bounds]:
    """:func:`extended_bounds` of exact inputs, which are the sound ones, and of such inputs, at once."""
    law = LawConstants.of(0.0, mu1, spacing, station)
    sound, extended = _bounds(perceived, rates, (InputErrors(), inputs), v_eps, law)
    return sound, extended


def _bounds(
    perceived: Perceived, rates: RateErrors, inputs: Sequence[InputErrors], v_eps: Values, law: LawConstants
) -> list[Bounds]:
    """Bounds for each of the input errors."""
    from estimation.bounds.entries import bound_all  # compiles, which who only needs the records is spared

    columns = (
        *(getattr(perceived, name) for name in Moment._fields),
        v_eps,
        *(
            column
            for each in inputs
            for column in (rates.M_rho, rates.M_alpha2, each.E_rho, each.E_alpha2, each.E_v2, each.E_u2)
        ),
    )
    shape = np.broadcast_shapes(*map(np.shape, columns))
    moments, found = np.empty((len(columns), *shape)), np.empty((len(inputs), 3, *shape))
    for k, column in enumerate(columns):
        moments[k] = column
    count = math.prod(shape)
    bound_all(moments.reshape(len(columns), count), row_of(law), found.reshape(3 * len(inputs), count))
    return [Bounds(*each) for each in found]


def _require_magnitudes(**bounds: Values) -> None:
    for name, value in bounds.items():
        if isinstance(value, float) and 0.0 <= value < math.inf:
            continue
        if not np.all(np.isfinite(value) & (np.asarray(value) >= 0.0)):
            raise ValueError(f"{name} is {value}, expected finite numbers >= 0")
