"""Gains proposed for a scenario: what its robots, leader, noise and delays come to, and the report on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from controllers.gain_design import Design, design
from controllers.gain_task import Task
from formation.invariant_set import Disturbed, invariant_set
from formation.shape import ABREAST_ALPHA2
from formation.spacing import Spacing
from hil.errors import UsageError
from hil.scenario.certificate import assumptions_of, certificate_of
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
        M_alpha2=certificate_of(scenario).claims()["rates"].figures["M_alpha2"],
    )


def propose(scenario: Scenario) -> dict[str, Any]:
    """JSON of ``abreast gains``: ``gains`` and what they come to, or ``why`` not; ``bounds`` of each gain."""
    task = task_of(scenario)
    found = design(task)
    control = scenario.controller
    result: dict[str, Any] = {
        "scenario": scenario.name,
        "gains": None,
        "why": found.why,
        "bounds": {name: asdict(bound) for name, bound in found.bounds.items()},
        "note": found.note,
        "given": {"mu1": control.mu1, "mu2": control.mu2, "mu_rho": control.mu_rho},
    }
    if found.gains is not None:
        result |= _outcome(found, found.gains, task)
    return result


def _outcome(found: Design, gains: tuple[float, float, float], task: Task) -> dict[str, Any]:
    mu1, mu2, mu_rho = (float(f"{gain:.4g}") for gain in gains)
    kept = invariant_set(Disturbed(mu1, Spacing(task.rho_0, mu_rho), task.speeds, task.k_u))
    return {
        "gains": {"mu1": mu1, "mu2": mu2, "mu_rho": mu_rho},
        "phase_margin": found.phase_margin,
        "delay_margin_s": found.delay_margin,
        "formation": None if kept is None else {"rho_min": kept.rho_min, "rho_max": kept.rho_max},
    }


def report_lines(proposal: dict[str, Any]) -> Iterator[str]:
    """The proposal as lines of text."""
    gains = proposal["gains"]
    if gains is None:
        yield f"no gains work: {proposal['why']}"
    for name, bound in proposal["bounds"].items():
        value = "" if gains is None else f" {gains[name]:g}"
        yield f"{name}{value}: at least {bound['least']:.3g}, for {bound['why_least']}"
        yield f"{' ' * len(name)}  at most {bound['most']:.3g}, for {bound['why_most']}"
    if gains is not None:
        margin = math.degrees(proposal["phase_margin"])
        yield f"phase margin {margin:.0f} deg; {proposal['delay_margin_s']:.2g} s of delay without prediction"
    if proposal["note"]:
        yield f"note: {proposal['note']}"
    if gains is not None:
        yield " ".join(f"--set controller.{name}={value:g}" for name, value in gains.items())
