"""Claims of the certificate about where the pair stays: distance and bearings, and what that rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from estimation.bounds.assumptions import Assumptions
from formation.error_set_kernels import ErrorModel
from formation.invariant_set import Disturbed, InvariantSet
from formation.joint_set import Aside, JointSet, joint_set, largest_error
from formation.station import Side
from formation.steering_margin import steering_margin

WHOLE = "the whole system (3) under laws (4) and (8), without limits or lag"
MANIFOLD = "the reduced system (5), that is alpha2 at rest, under law (8), without limits or lag"
START = "a start inside the set"
NOT_SAFETY = (
    "boundedness, not safety: rho lies between the middles of two robots, which touch where it comes down to "
    "their width (a TurtleBot3 Burger is 0.178 m wide)"
)


@dataclass(frozen=True, slots=True)
class Claim:
    """Guaranteed figures by name (none if nothing is guaranteed), what they rest on, and why some miss."""

    figures: dict[str, float] = field(default_factory=dict)
    assumes: tuple[str, ...] = ()
    why: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """The figures, ``assumes``, and ``why`` where there is one, as plain values."""
        entry: dict[str, Any] = {**self.figures, "assumes": list(self.assumes)}
        return entry if self.why is None else entry | {"why": self.why}


def formation_in(given: Assumptions, system: Disturbed, held: InvariantSet | None, besides: str) -> Claim:
    """What is guaranteed in a set of the reduced system, or why there is none; ``besides``: of estimates."""
    speeds = system.speeds
    drives = (
        f"v1 = {speeds.lowest:g} m/s, constant"
        if speeds.lowest == speeds.highest
        else f"v1 anywhere between {speeds.lowest:g} and {speeds.highest:g} m/s"
    )
    assumes = (f"|u1| <= k_u = {given.k_u:g} rad/s", drives, besides, MANIFOLD, START, NOT_SAFETY)
    if held is None:
        return Claim({}, assumes, given.unproved or _why_not_held(given, system))
    return Claim(extremes(given, held), assumes)


def extremes(given: Assumptions, held: InvariantSet | JointSet) -> dict[str, float]:
    """Least and largest rho and alpha1 of a set, on the side that is given."""
    # The left is the right's mirror image, which changes the sign of every bearing.
    low, high = (held.alpha1_min, held.alpha1_max)
    if given.side is Side.LEFT:
        low, high = -high, -low
    return {"rho_min": held.rho_min, "rho_max": held.rho_max, "alpha1_min": low, "alpha1_max": high}


def _why_not_held(given: Assumptions, system: Disturbed) -> str:
    reach = given.spacing.mu_rho * system.speeds.lowest
    if reach <= system.D:
        return (
            f"a constant turn of {system.D:.3g} rad/s is not below mu_rho v1 = {reach:.3g} rad/s: "
            "no distance balances it"
        )
    return f"the worst steering within {system.D:.3g} rad/s carries alpha1 past its saddle"


def wrong_velocity(error: float) -> str:
    """That the leader's velocity is believed wrong by up to W = ``error`` [m/s], in words."""
    return f"the believed velocity of the leader off by at most W = {error:.4g} m/s, in any direction"


def formation_by_line(given: Assumptions, system: Disturbed) -> Claim:
    """The set with alpha2 for what a straight line through positions of independent noise errs by."""
    samples, error = given.line
    claim = formation_with_alpha2(given, error, system)
    averaged = (
        "W: noise independent from frame to frame, so that it averages out in the straight line through the "
        f"positions of the last {samples * given.step:.3g} s, whose slope errs by at most 5 of its standard "
        "deviations by noise; bodies that rock as they drive are noisier than that"
    )
    return replace(claim, assumes=(*claim.assumes, averaged))


def formation_with_alpha2(given: Assumptions, velocity_error: float, system: Disturbed) -> Claim:
    """The set of rho, alpha1 and alpha2 together, all moved by one wrong velocity; at constant speed only."""
    speeds, spacing = system.speeds, given.spacing
    besides = wrong_velocity(velocity_error)
    plane = formation_in(given, system, None, besides).assumes
    assumes = tuple(WHOLE if assumed == MANIFOLD else assumed for assumed in plane)
    if unknown := given.unproved or given.unknown_steering:
        return Claim({}, assumes, unknown)
    if speeds.lowest != speeds.highest:
        return Claim({}, assumes, "the set with alpha2 is known of leaders of constant speed only")
    model = ErrorModel(given.mu1, spacing.rho_0, spacing.mu_rho, speeds.lowest, given.k_u, velocity_error)
    found = joint_set(model, Aside(given.mu2))
    if found is None:
        return Claim({}, assumes, _why_not_joint(model, given.mu2))
    ball = (
        f"alpha2 within {found.alpha2_within:.3g} rad of its place at the least distance, and within "
        f"{float(found.radius(np.array(found.rho_max))):.3g} rad at the largest, where less moves it; proved "
        f"piece by piece along the whole boundary, which every motion crosses inwards at {found.inward:.1e} "
        "rho_0 or rad a second at the least"
    )
    figures = extremes(given, found) | {"alpha2_within": found.alpha2_within, "W": velocity_error}
    return Claim(figures, (*assumes, ball), None)


def _why_not_joint(model: ErrorModel, mu2: float) -> str:
    closes = largest_error(model, Aside(mu2))
    most = f"up to {math.floor(1e4 * closes) / 1e4:g} m/s" if closes > 0.0 else "for none"
    return (
        f"with alpha2 moved by an error within W = {model.W:.3g} m/s, and back at mu2 = {mu2:g} rad/s, the "
        f"worst motion does not close; computed, not proved, it closes {most}"
    )


def k_u_star(given: Assumptions) -> Claim:
    """The bracket of k_u* of Prop. 3, for a leader of constant speed."""
    speeds = given.speeds
    assumes = ("exact estimates", MANIFOLD, f"v1 = {speeds.lowest:g} m/s, constant")
    if given.unproved:
        return Claim({}, assumes, given.unproved)
    if speeds.lowest != speeds.highest:
        why = (
            "Prop. 3 is about a leader of constant speed; "
            f"this one drives {speeds.lowest:g} to {speeds.highest:g} m/s"
        )
        return Claim({}, (*assumes[:2], "a constant v1"), why)
    margin = steering_margin(given.mu1, given.spacing, speeds.lowest)
    below = "lower: below it one stable orbit in a set that keeps all its motions"
    lower = (
        f"{below} is proved: contraction in a metric, in interval arithmetic over the whole set"
        if margin.proved
        else f"{below} is computed, not proved: contraction in a constant metric"
    )
    upper = "upper: above it a periodic steering is known that throws the pair off"
    return Claim({"lower": margin.lower, "upper": margin.upper}, (*assumes, lower, upper))
