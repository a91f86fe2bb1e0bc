"""Gains proposed for a scenario: what its robots, leader, noise and delays come to, and the report on it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from controllers.gain_design import Design, design
from controllers.gain_task import Task
from estimation.bounds.certificate import rates_claim
from formation.invariant_set import Disturbed, invariant_set
from formation.shape import ABREAST_ALPHA2
from formation.spacing import Spacing
from hil.errors import UsageError
from hil.log.report_json import known
from hil.scenario.certificate import assumptions_of
from hil.scenario.leader_model import process_noise
from hil.scenario.parts import limits
from hil.scenario.schema import Scenario


def task_of(scenario: Scenario) -> Task:
    """What a scenario asks of a follower, its estimates as good as a filter in its steady state makes them.

    The filter of :mod:`estimation.tracking.turn_prediction` on positions of standard deviation sigma has the
    corner w0 = (v^2 q / (sigma^2 / rate))^(1/6) and the variance 3 w0^3 sigma^2 / rate of the leader's
    velocity. Raises :class:`UsageError` for a station that is not abreast: the bounds hold there only.
    """
    if scenario.formation.bearing != ABREAST_ALPHA2:
        raise UsageError(
            f"scenario {scenario.name}: formation.bearing is {scenario.formation.bearing}, expected pi/2: "
            "gains are designed for followers abreast only; leave it out"
        )
    given, leader, assumptions = scenario.estimator, scenario.leader, assumptions_of(scenario)
    world = given.front_end == "world"
    rho_0, rate = scenario.formation.rho_0, scenario.mocap.rate_hz
    sigma = given.sigma_position if world else max(given.sigma_range, rho_0 * given.sigma_bearing)
    noise = process_noise(scenario)
    slow, density = assumptions.speeds.lowest, sigma * sigma / rate
    corner = (slow * slow * noise.q_u / density) ** (1.0 / 6.0)
    sd_v1 = math.sqrt(3.0 * corner**3 * density)
    across = math.sqrt(2.0) * sigma / rho_0
    control = scenario.controller
    return Task(
        rho_0=rho_0,
        limits=limits(scenario),
        speeds=assumptions.speeds,
        k_u=leader.k_u,
        delay=scenario.mocap.latency_s + control.transport_s + control.lag_s,
        sd_v1=sd_v1,
        sd_alpha1=math.hypot(sd_v1 / slow, across),
        sd_rho=math.sqrt(2.0) * sigma if world else given.sigma_range,
        sd_alpha2=math.hypot(given.sigma_heading, across) if world else given.sigma_bearing,
        M_alpha2=rates_claim(assumptions).figures["M_alpha2"],
    )


@dataclass(frozen=True, slots=True)
class GainProposal:
    """Gains proposed for a scenario, or ``why`` none work.

    ``gains``: mu1, mu2 [rad/s], mu_rho [1/m] by name, None if none work. ``bounds``: of each gain ``least``
    and ``most``, with ``why_least`` and ``why_most``. ``given``: the scenario's own gains.
    ``phase_margin`` [rad], ``delay_margin_s`` [s] and ``formation`` (``rho_min``, ``rho_max`` [m]), what they
    come to; None where it is not known.

    >>> import abreast
    >>> found = abreast.gains("turtlebot3")
    >>> sorted(found.gains), found.gains["mu1"] > 0.0
    (['mu1', 'mu2', 'mu_rho'], True)
    """

    scenario: str
    gains: Mapping[str, float] | None
    why: str | None
    bounds: Mapping[str, Mapping[str, Any]]
    note: str | None
    given: Mapping[str, float]
    phase_margin: float | None = None
    delay_margin_s: float | None = None
    formation: Mapping[str, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The JSON of ``abreast gains``."""
        result: dict[str, Any] = known(asdict(self))
        return result


def propose(scenario: Scenario) -> GainProposal:
    """Gains for a scenario, with what bounds each. Raises :class:`UsageError` as :func:`task_of`."""
    task = task_of(scenario)
    found = design(task)
    control = scenario.controller
    return GainProposal(
        scenario=scenario.name,
        why=found.why,
        bounds={name: asdict(bound) for name, bound in found.bounds.items()},
        note=found.note,
        given={"mu1": control.mu1, "mu2": control.mu2, "mu_rho": control.mu_rho},
        **({"gains": None} if found.gains is None else _outcome(found, found.gains, task)),
    )


def _outcome(found: Design, gains: tuple[float, float, float], task: Task) -> dict[str, Any]:
    mu1, mu2, mu_rho = (float(f"{gain:.4g}") for gain in gains)
    kept = invariant_set(Disturbed(mu1, Spacing(task.rho_0, mu_rho), task.speeds, task.k_u))
    return {
        "gains": {"mu1": mu1, "mu2": mu2, "mu_rho": mu_rho},
        "phase_margin": found.phase_margin,
        "delay_margin_s": found.delay_margin,
        "formation": None if kept is None else {"rho_min": kept.rho_min, "rho_max": kept.rho_max},
    }


def report_lines(proposal: GainProposal) -> Iterator[str]:
    """The proposal as lines of text."""
    gains = proposal.gains
    if gains is None:
        yield f"no gains work: {proposal.why}"
    for name, bound in proposal.bounds.items():
        value = "" if gains is None else f" {gains[name]:g}"
        yield f"{name}{value}: at least {bound['least']:.3g}, for {bound['why_least']}"
        yield f"{' ' * len(name)}  at most {bound['most']:.3g}, for {bound['why_most']}"
    if gains is not None and proposal.phase_margin is not None:
        margin = math.degrees(proposal.phase_margin)
        yield f"phase margin {margin:.0f} deg; {proposal.delay_margin_s:.2g} s of delay without prediction"
    if proposal.note:
        yield f"note: {proposal.note}"
    if gains is not None:
        yield " ".join(f"--set controller.{name}={value:g}" for name, value in gains.items())
