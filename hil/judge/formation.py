"""How well the formation was kept: the true shape, and its distance from the noise-free run."""

from __future__ import annotations

import math

import numpy as np

from formation.angles import FloatArray, wrap
from hil.judge.columns import Columns, inside
from hil.judge.noise_free_orbit import noise_free_orbit
from hil.judge.run_data import RunData
from hil.judge.side_orders import desired_bearings


def judge_formation(run_data: RunData, columns: Columns) -> dict[str, object]:
    """The ``formation`` part of a summary, from the truth within the evaluation; empty without truth.

    ``equilibrium_deviation_rms`` from rho_0 and the alpha1 of the station, that of the side that was ordered
    last, where the law ``ideal`` settles.
    ``orbit_deviation_rms`` against :func:`hil.judge.noise_free_orbit.noise_free_orbit`, for emulated runs.
    """
    truth, span = columns.truth, columns.span
    known = inside(truth.capture_ns, span) & np.isfinite(truth.rho)
    if not np.any(known):
        return {}
    rho, alpha1, alpha2 = truth.rho[known], truth.alpha1[known], truth.alpha2[known]
    desired_alpha1, _ = desired_bearings(run_data.scenario, run_data.orders, truth.capture_ns[known])
    result: dict[str, object] = {
        "rho_final": float(rho[-1]),
        "alpha1_final": float(alpha1[-1]),
        "alpha2_final": float(alpha2[-1]),
        "rho_min": float(rho.min()),
        "rho_max": float(rho.max()),
        "equilibrium_deviation_rms": {
            "rho": _rms(rho - run_data.scenario.formation.rho_0),
            "alpha1": _rms(wrap(alpha1 - desired_alpha1)),
        },
    }
    driven = run_data.motion_since_ns is not None
    scenario, orders = run_data.scenario, run_data.orders
    orbit = noise_free_orbit(scenario, truth, columns.run, orders) if driven else None
    if orbit is not None:
        orbit_rho, orbit_alpha1, _ = orbit.at(truth.capture_ns[known])
        result["orbit_deviation_rms"] = {
            "rho": _rms(rho - orbit_rho),
            "alpha1": _rms(wrap(alpha1 - orbit_alpha1)),
        }
    return result


def _rms(deviation: FloatArray) -> float:
    return math.sqrt(float(np.mean(deviation * deviation)))
