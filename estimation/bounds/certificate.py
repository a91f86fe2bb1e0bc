"""The certificate: from noise bounds and leader limits to what is guaranteed of estimates and formation.

Every claim says what it rests on, and where nothing can be claimed, why. The chain: a bound eps of the noise
and a bound A of the leader's acceleration give the error W of its velocity, in any direction, that the best
difference over a window guarantees; W gives the bounds on rates, on v1 and alpha1, and on h; the rate of
alpha2 its ultimate bound; the leader's turn rate the invariant set of (rho, alpha1), without and with the
errors of h, and with alpha2, where noise may lean to one side for ever and where it averages out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from estimation.bounds.assumptions import Assumptions
from estimation.bounds.error_bounds import Perceived, RateErrors, paper_h, sound_h
from estimation.bounds.formation_claims import (
    Claim,
    extremes,
    formation_by_line,
    formation_in,
    formation_with_alpha2,
    k_u_star,
    wrong_velocity,
)
from estimation.bounds.guarantees import alpha2_ultimate, guaranteed_rate
from formation.angles import FloatArray
from formation.error_set import error_set
from formation.error_set_kernels import ErrorModel
from formation.invariant_set import Disturbed, InvariantSet, invariant_set
from formation.speed_range import SpeedRange

_GRID = 33
_ROUNDS = 50
_SETTLED = 1e-6


@dataclass(frozen=True, slots=True)
class Certificate:
    """All claims; ``velocity_error``: guaranteed error W of the leader's velocity [m/s] in any direction.

    Each claim has its ``figures`` by name, what it ``assumes``, and ``why`` there are none if there are none.

    >>> import abreast
    >>> found = abreast.bounds("turtlebot3")
    >>> print(f"v1 within {found.estimates.figures['M_v1']:.4f} m/s, {found.formation.assumes[0]}")
    v1 within 0.0205 m/s, |u1| <= k_u = 0.7 rad/s
    """

    velocity_error: float
    rates: Claim
    estimates: Claim
    h: Claim
    alpha2_ultimate: Claim
    formation: Claim
    formation_any_speed: Claim
    formation_with_errors: Claim
    formation_with_alpha2: Claim
    formation_independent_noise: Claim
    k_u_star: Claim

    def claims(self) -> dict[str, Claim]:
        """Claims by name, in the order in which they follow from each other."""
        names = [name for name in self.__slots__ if name != "velocity_error"]
        return {name: getattr(self, name) for name in names}

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """The JSON of ``abreast bounds``: per claim its figures, ``assumes``, and ``why``."""
        return {name: claim.as_dict() for name, claim in self.claims().items()}


@lru_cache(maxsize=32)
def certify(given: Assumptions) -> Certificate:
    """Certificate of a pair and its leader; takes a second or so, the first time."""
    velocity_error = given.velocity_error
    system, held = _held(given)
    rates = _rates(given, velocity_error, held)
    return Certificate(
        velocity_error=velocity_error,
        rates=rates,
        estimates=_estimates(given, velocity_error),
        h=_h(given, velocity_error, held),
        alpha2_ultimate=_alpha2_ultimate(given, rates.figures["M_alpha2"]),
        formation=formation_in(given, system, held, "exact estimates"),
        formation_any_speed=_formation_any_speed(given, system),
        formation_with_errors=_formation_with_errors(given, velocity_error, system, held),
        formation_with_alpha2=formation_with_alpha2(given, velocity_error, system),
        formation_independent_noise=formation_by_line(given, system),
        k_u_star=k_u_star(given),
    )


def formation_claim(given: Assumptions) -> Claim:
    """The claim ``formation`` of :func:`certify` alone: for those who go through many."""
    return formation_in(given, *_held(given), "exact estimates")


def rates_claim(given: Assumptions) -> Claim:
    """The claim ``rates`` of :func:`certify` alone."""
    return _rates(given, given.velocity_error, _held(given)[1])


@lru_cache(maxsize=32)
def _held(given: Assumptions) -> tuple[Disturbed, InvariantSet | None]:
    """The reduced system with exact estimates, and its set if there is one that is known."""
    system = Disturbed(given.mu1, given.spacing, given.speeds, given.k_u)
    return system, None if given.unproved else invariant_set(system)


def _sources(given: Assumptions) -> tuple[str, ...]:
    return (
        f"noise: {given.noise}",
        f"v1 <= k_v = {given.k_v:g} m/s at constant speed and |u1| <= k_u = {given.k_u:g} rad/s, "
        f"so that the leader accelerates by at most {given.acceleration:.3g} m/s^2",
        f"a measurement every {1e3 * given.step:.3g} ms over the window, none missing",
        "a plain difference over the best window; a Kalman filter errs less as a rule, more at its worst",
    )


def _rates(given: Assumptions, velocity_error: float, held: InvariantSet | None) -> Claim:
    nearest, which = _nearest(given, held)
    figures = {
        "M_rho": velocity_error,
        "M_alpha2": velocity_error / nearest,
        "closed_form": float(guaranteed_rate(given.eps, given.acceleration)),
        "eps": given.eps,
        "acceleration": given.acceleration,
    }
    own = "the follower's own pose and motion are exact (the appendix of the paper)"
    return Claim(figures, (*_sources(given), own, f"rho >= {nearest:.3g} m ({which})"))


def _nearest(given: Assumptions, held: InvariantSet | None) -> tuple[float, str]:
    if held is None:
        return given.spacing.rho_0, "the desired distance, as no set is certified"
    return held.rho_min, "least distance of the certified formation"


def _estimates(given: Assumptions, velocity_error: float) -> Claim:
    assumes = (*_sources(given), f"v1 >= v_eps = {given.v_eps:g} m/s")
    figures = {"M_v1": velocity_error}
    if given.filter_error is not None:
        figures["M_v1_filter"] = given.filter_error
        assumes = (
            *assumes,
            "M_v1_filter: the extended filter that flies, once settled, at its worst (linearised)",
        )
    if given.v_eps <= velocity_error:
        why = (
            f"M_alpha1: the velocity's error {velocity_error:.3g} m/s reaches v_eps = {given.v_eps:g} m/s, "
            "so that any direction is possible"
        )
        return Claim(figures, assumes, why)
    return Claim(figures | {"M_alpha1": math.asin(velocity_error / given.v_eps)}, assumes)


def _h(given: Assumptions, velocity_error: float, held: InvariantSet | None) -> Claim:
    rho, alpha1 = _states(given, velocity_error, held)
    where = "rho_0 and alpha1 at its station" if held is None else "the certified formation"
    paper, sound = _h_bounds(given, velocity_error, rho, alpha1)
    assumes = (*_sources(given), f"v1 >= v_eps = {given.v_eps:g} m/s", f"worst over {where}")
    return Claim({"paper": float(paper.max()), "sound": float(sound.max())}, assumes)


def _h_bounds(
    given: Assumptions, velocity_error: float, rho: FloatArray, alpha1: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bounds of h in the paper's and the sound form at believed states.

    Both rate errors come from one error W of the velocity, so that M = W: in the sound form all of it may lie
    across the line between the robots, and the part along that line adds nothing then.
    """
    seen = Perceived(rho, 0.5 * math.pi, 0.0, 0.0, given.v_eps, alpha1, 0.0, 0.0)
    printed = paper_h(seen, RateErrors(velocity_error, velocity_error / rho), given.mu1, given.spacing)
    sound = sound_h(seen, RateErrors(0.0, velocity_error / rho), given.v_eps, given.mu1, given.spacing)
    return printed, sound


def _states(
    given: Assumptions, velocity_error: float, held: InvariantSet | None
) -> tuple[FloatArray, FloatArray]:
    """Distances and believed bearings of the certified set, or of the equilibrium without one."""
    wrong = math.asin(velocity_error / given.v_eps) if given.v_eps > velocity_error else math.pi
    if held is None:
        return np.full(_GRID, given.spacing.rho_0), -0.5 * math.pi + np.linspace(-wrong, wrong, _GRID)
    rho = np.linspace(held.rho_min, held.rho_max, _GRID)
    lowest, highest = held.span(rho)
    share = np.linspace(0.0, 1.0, _GRID)[:, np.newaxis]
    alpha1 = (1.0 - share) * (lowest - wrong) + share * (highest + wrong)
    return np.broadcast_to(rho, alpha1.shape), alpha1


def _alpha2_ultimate(given: Assumptions, M_alpha2: float) -> Claim:
    assumes = (
        f"|alpha2_dot error| <= M_alpha2 = {M_alpha2:.3g} rad/s",
        "steering law (4), carried out at once",
    )
    if given.unknown_steering:
        return Claim({}, assumes, given.unknown_steering)
    if M_alpha2 >= given.mu2:
        why = (
            f"M_alpha2 = {M_alpha2:.3g} rad/s >= mu2 = {given.mu2:g} rad/s: "
            "the error can outweigh the steering"
        )
        return Claim({}, assumes, why)
    return Claim({"value": float(alpha2_ultimate(M_alpha2, given.mu2))}, assumes)


def _formation_any_speed(given: Assumptions, system: Disturbed) -> Claim:
    any_speed = replace(system, speeds=SpeedRange(given.v_eps, given.k_v))
    held = None if given.unproved else invariant_set(any_speed)
    return formation_in(given, any_speed, held, "exact estimates")


def _formation_with_errors(
    given: Assumptions, velocity_error: float, system: Disturbed, held: InvariantSet | None
) -> Claim:
    """The set under one wrong velocity in all terms at once; by the bound of h where v1 varies.

    alpha2 is at rest in it. ``assumes`` tells how far the same error moves it.
    """
    if given.unproved or system.speeds.lowest != system.speeds.highest:
        return _formation_by_h(given, velocity_error, system, held)
    v1, spacing = system.speeds.lowest, given.spacing
    model = ErrorModel(given.mu1, spacing.rho_0, spacing.mu_rho, v1, given.k_u, velocity_error)
    found = error_set(model)
    besides = wrong_velocity(velocity_error)
    if found is None:
        why = (
            f"the worst steering within {given.k_u:g} rad/s with the worst belief within "
            f"{velocity_error:.3g} m/s carries alpha1 past its saddle, or the robots apart"
        )
        return Claim({}, formation_in(given, system, None, besides).assumes, why)
    assumes = (
        *formation_in(given, system, found.inside, besides).assumes,
        "proved piece by piece along the whole boundary, which every motion crosses inwards at "
        f"{found.inward:.1e} rho_0 or rad a second at the least",
        _moved_aside(given, velocity_error / found.inside.rho_min),
    )
    return Claim(extremes(given, found.inside) | {"W": velocity_error}, assumes)


def _moved_aside(given: Assumptions, M_alpha2: float) -> str:
    """How far a wrong belief of the leader moves alpha2, in words."""
    if not M_alpha2 < given.mu2:
        return (
            f"alpha2 at rest, though its rate errs by up to {M_alpha2:.3g} rad/s, which mu2 does not outweigh"
        )
    ball = float(alpha2_ultimate(M_alpha2, given.mu2))
    return (
        f"alpha2 at rest: its rate errs by up to W / rho_min = {M_alpha2:.3g} rad/s, which keeps it within "
        f"{ball:.3g} rad; the set does not allow for that"
    )


def _formation_by_h(
    given: Assumptions, velocity_error: float, system: Disturbed, held: InvariantSet | None
) -> Claim:
    """The set for D = k_u + the largest bound of h within it: enlarged until it holds for itself."""
    besides = "estimates as wrong as the sound bound of h allows"
    disturbed = system
    for _ in range(_ROUNDS):
        if held is None:
            return formation_in(given, disturbed, None, besides)
        error = float(_h_bounds(given, velocity_error, *_states(given, velocity_error, held))[1].max())
        enlarged = given.k_u + error
        if abs(enlarged - disturbed.D) <= _SETTLED:
            claim = formation_in(given, disturbed, held, f"{besides}, {error:.3g} rad/s")
            return replace(claim, figures=claim.figures | {"W": velocity_error})
        disturbed = replace(disturbed, D=enlarged + 0.5 * _SETTLED)
        held = invariant_set(disturbed)
    return Claim({}, (besides,), "the set and the error of h within it keep enlarging each other")
