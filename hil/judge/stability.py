"""The paper's propositions, checked with numbers: Lyapunov function, region of attraction, gain, margin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controllers.attraction import SettlingMap, settling_map
from controllers.limits import Limits
from formation.angles import FloatArray
from formation.closed_loop import Trajectory
from formation.invariant_set import Disturbed, invariant_set
from formation.shape import ABREAST_ALPHA2
from formation.spacing import Spacing, lyapunov
from formation.speed_range import SpeedRange
from formation.steering_margin import SteeringMargin, steering_margin
from hil.errors import UsageError
from hil.extensions.reference import is_reference, short
from hil.scenario import parts as scenario_parts
from hil.scenario.schema import Scenario

PROVED_V1 = 2.0
FREE = Limits(1e9, 1e9)
_ROWS, _COLUMNS = 33, 48
_NEAREST, _FARTHEST = 0.25, 4.0
_HORIZON = 60.0
_GAIN_STEPS = 24


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """How far the pair leaves its station against how hard the leader may turn; arrays of shape (n,).

    ``k_u`` [rad/s] below ``end``; ``rho_min``, ``rho_max``: worst over all steering within k_u, nan where
    nothing holds; ``rho_inward``, ``rho_outward``: for a constant turn of -k_u and +k_u. ``end`` is
    mu_rho v1, at and above which a constant turn leaves no equilibrium.
    """

    k_u: FloatArray
    rho_min: FloatArray
    rho_max: FloatArray
    rho_inward: FloatArray
    rho_outward: FloatArray
    end: float


@dataclass(frozen=True, slots=True, eq=False)
class Stability:
    """All that is checked: V1 along the run, maps without and within limits, gain, bracket of k_u*."""

    trajectory: Trajectory
    V1: FloatArray
    free: SettlingMap
    limited: SettlingMap
    turned: SettlingMap
    gain: Gain
    margin: SteeringMargin


def stability_of(scenario: Scenario, trajectory: Trajectory) -> Stability:
    """Check the propositions for a scenario's gains and its leader's speed at the start.

    Raises :class:`UsageError` for a station that isn't abreast: the margins are proved there only. The maps
    are of the right-hand side, whose mirror image the left is.
    """
    if scenario.formation.bearing != ABREAST_ALPHA2 or scenario.formation.side != "right":
        raise UsageError(
            f"scenario {scenario.name}: formation has side {scenario.formation.side!r} and bearing "
            f"{scenario.formation.bearing}, expected a follower abreast on the right; leave out --stability"
        )
    if scenario.formation.change_sides_at_s:
        raise UsageError(
            f"scenario {scenario.name}: formation.change_sides_at_s is set, but the propositions are about "
            "one side; leave out --stability"
        )
    if is_reference(scenario.controller.law):
        raise UsageError(
            f"scenario {scenario.name}: controller.law is {short(scenario.controller.law)}, but the "
            "propositions are about the paper's laws; leave out --stability"
        )
    gains, limits = scenario_parts.gains(scenario), scenario_parts.limits(scenario)
    v1 = scenario_parts.leader_program(scenario)(0.0).v
    if not v1 > 0.0:
        raise UsageError(f"scenario {scenario.name}: leader.program has v = {v1} at the start, expected more")
    spacing = gains.spacing
    rho = spacing.rho_0 * np.geomspace(_NEAREST, _FARTHEST, _ROWS)
    alpha1 = np.linspace(-math.pi, math.pi, _COLUMNS, endpoint=False) + math.pi / _COLUMNS
    horizon = _HORIZON * max(1.0, spacing.rho_0 / v1)
    turned = -ABREAST_ALPHA2 + 0.5
    return Stability(
        trajectory=trajectory,
        V1=np.array([lyapunov(trajectory.shape_at(row), spacing) for row in range(len(trajectory.t))]),
        free=settling_map(gains, FREE, v1, rho, alpha1, ABREAST_ALPHA2, horizon),
        limited=settling_map(gains, limits, v1, rho, alpha1, ABREAST_ALPHA2, horizon),
        turned=settling_map(gains, limits, v1, rho, alpha1, turned, horizon),
        gain=gain_of(gains.mu1, spacing, v1),
        margin=steering_margin(gains.mu1, spacing, v1),
    )


def gain_of(mu1: float, spacing: Spacing, v1: float) -> Gain:
    """Ultimate distances under law (8) against the bound on the leader's turn rate, constant speed v1."""
    end = spacing.mu_rho * v1
    k_u = end * np.linspace(0.0, 1.0, _GAIN_STEPS, endpoint=False)[1:]
    extremes = np.full((2, len(k_u)), math.nan)
    for column, bound in enumerate(k_u.tolist()):
        held = invariant_set(Disturbed(mu1, spacing, SpeedRange(v1, v1), bound))
        if held is None:
            break
        extremes[:, column] = held.rho_min, held.rho_max
    inward, outward = (
        np.array([spacing.distance(turn * bound / v1) for bound in k_u.tolist()]) for turn in (-1.0, 1.0)
    )
    return Gain(k_u, extremes[0], extremes[1], inward, outward, end)


def stability_json(found: Stability) -> dict[str, object]:
    """Report of the checks, as ``stability`` of ``abreast simulate --stability``."""
    below = np.flatnonzero(found.V1 >= PROVED_V1)
    after = int(below[-1]) + 1 if len(below) else 0
    held = np.isfinite(found.gain.rho_max)
    return {
        "V1_final": float(found.V1[-1]),
        "V1_largest_rise": float(np.maximum(0.0, np.diff(found.V1)).max()),
        "V1_below_2_from_s": float(found.trajectory.t[after]) if after < len(found.V1) else None,
        "settled_share": {
            "free": found.free.share,
            "limited": found.limited.share,
            "limited_turned": found.turned.share,
        },
        "gain": {
            "k_u": found.gain.k_u[held],
            "rho_min": found.gain.rho_min[held],
            "rho_max": found.gain.rho_max[held],
            "ends_at": found.gain.end,
        },
        "k_u_star": {"lower": found.margin.lower, "upper": found.margin.upper},
    }
