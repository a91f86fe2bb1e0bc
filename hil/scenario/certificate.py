"""A scenario's certificate: its assumptions from the scenario, its JSON, and its text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from estimation.bounds.assumptions import Assumptions
from estimation.bounds.filter_response import Disturbances, FlyingFilter, worst_responses
from estimation.bounds.guarantees import leader_acceleration
from formation.shape import ABREAST_ALPHA2
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.station import Side
from hil.extensions.reference import is_reference, short
from hil.scenario.kept_certificates import kept_certificate
from hil.scenario.leader_model import leader_limits, process_noise
from hil.scenario.noise_bounds import NOISE_SIGMAS, position_bound
from hil.scenario.schema import Scenario, TableProgram

if TYPE_CHECKING:
    from estimation.bounds.certificate import Certificate


_STANDS = 1e-9
"""What drives more slowly [m/s] stands, for all that can be told of it."""


def certificate_of(scenario: Scenario, *, driven: bool = True) -> Certificate:
    """Certificate of a scenario; ``driven``: its program drives the leader, which tells the speeds.

    Of a recorded leader nothing but its limits is known.
    """
    return kept_certificate(assumptions_of(scenario, driven=driven))


def assumptions_of(scenario: Scenario, *, driven: bool = True) -> Assumptions:
    """What the certificate of a scenario starts from."""
    leader, law = scenario.leader, scenario.controller
    eps, of_what = _noise(scenario)
    return Assumptions(
        eps=eps,
        step=1.0 / scenario.mocap.rate_hz,
        v_eps=leader.v_eps,
        k_v=leader.k_v,
        k_u=leader.k_u,
        speeds=_speeds(scenario) if driven else SpeedRange(leader.v_eps, leader.k_v),
        mu1=law.mu1,
        mu2=law.mu2,
        spacing=Spacing(scenario.formation.rho_0, law.mu_rho),
        noise=f"positions within {NOISE_SIGMAS:g} sigma = {1e3 * eps:.3g} mm ({of_what})",
        side=Side(scenario.formation.side),
        unproved=_unproved(scenario),
        unknown_steering=_other_law(scenario),
        filter_error=_filter_error(scenario, eps),
    )


def _filter_error(scenario: Scenario, eps: float) -> float | None:
    """Largest velocity error of the extended filter with the process noise that the scenario tells."""
    given, leader = scenario.estimator, scenario.leader
    if (given.kind, given.front_end) != ("ekf", "world"):
        return None
    flying = FlyingFilter(
        given.sigma_position, 1.0 / scenario.mocap.rate_hz, process_noise(scenario), leader_limits(scenario)
    )
    bounds = Disturbances(eps, float(leader_acceleration(leader.k_v, leader.k_u)))
    return worst_responses(flying, bounds).velocity


def _unproved(scenario: Scenario) -> str:
    """Why nothing is known of the formation that this scenario's follower keeps; empty if something is."""
    law, bearing = scenario.controller, scenario.formation.bearing
    if other := _other_law(scenario):
        return other
    if bearing != ABREAST_ALPHA2:
        return f"the set is known abreast only, and formation.bearing is {bearing:g} rad"
    if law.tilt != 0.0:
        return f"the set is known without tilt only, and controller.tilt is {law.tilt:g} rad"
    return ""


def _other_law(scenario: Scenario) -> str:
    """That the law is none of the paper's; empty if it is one."""
    law = scenario.controller.law
    return (
        f"it is known of the paper's laws only, and controller.law is {short(law)}"
        if is_reference(law)
        else ""
    )


def _noise(scenario: Scenario) -> tuple[float, str]:
    """Bound of the error of a leader position in the worst direction [m], and what of."""
    given = scenario.estimator
    if given.front_end == "world":
        return position_bound(scenario), "motion capture"
    rho_0 = scenario.formation.rho_0
    sigma = max(given.sigma_range, rho_0 * given.sigma_bearing)
    return NOISE_SIGMAS * sigma, f"range and bearing at {rho_0:g} m"


def _speeds(scenario: Scenario) -> SpeedRange:
    program = scenario.leader.program
    driven = program.v if isinstance(program, TableProgram) else [program.v]
    speeds = [abs(v) for v in driven]
    if min(speeds) < _STANDS or min(driven) < 0.0 < max(driven):
        return SpeedRange(scenario.leader.v_eps, scenario.leader.k_v)
    return SpeedRange(min(speeds), max(speeds))


def certificate_json(certificate: Certificate) -> dict[str, Any]:
    """JSON of ``abreast bounds``."""
    return certificate.as_dict()


_SET = "rho {rho_min:.4f} to {rho_max:.4f} m, alpha1 {alpha1_min:.4f} to {alpha1_max:.4f} rad"
_JOINT = _SET + ", alpha2 within {alpha2_within:.4f} rad"
_TITLES = {
    "rates": ("rates", "M_rho {M_rho:.4f} m/s, M_alpha2 {M_alpha2:.4f} rad/s"),
    "estimates": ("estimates", "v1 within {M_v1:.4f} m/s"),
    "h": ("error of h", "{sound:.4f} rad/s (by the paper's form {paper:.4f}, which is not a bound)"),
    "alpha2_ultimate": ("alpha2", "ends within {value:.4f} rad of where it is steered"),
    "formation": ("formation", ""),
    "formation_any_speed": ("  at any speed", ""),
    "formation_with_errors": ("  with wrong estimates", ""),
    "formation_with_alpha2": ("  and alpha2 moving", _JOINT),
    "formation_independent_noise": ("  by independent noise", _JOINT),
    "k_u_star": ("k_u* of Prop. 3", "between {lower:.4f} and {upper:.4f} rad/s"),
}
_PRINTED = 1e4


_FLOORED = ("rho_min", "alpha1_min", "lower")
"""What is bounded from below; all else from above."""


def _rounded(figures: Mapping[str, float]) -> dict[str, float]:
    """Figures as they are printed, to four digits behind the point and to the safe side."""
    return {
        name: (math.floor if name in _FLOORED else math.ceil)(_PRINTED * value) / _PRINTED
        for name, value in figures.items()
    }


def certificate_lines(certificate: Certificate) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Per claim a name, what is guaranteed or why nothing is, and what it assumes."""
    for name, claim in certificate.claims().items():
        title, text = _TITLES[name]
        figures = claim.figures
        finding = (text or _SET).format(**_rounded(figures)) if figures else "nothing is guaranteed"
        if "M_v1_filter" in figures:
            finding += f" ({_rounded(figures)['M_v1_filter']:.4f} by the filter that flies)"
        if "M_alpha1" in figures:
            finding += f", alpha1 within {_rounded(figures)['M_alpha1']:.4f} rad"
        yield title, finding + (f": {claim.why}" if claim.why else ""), claim.assumes
