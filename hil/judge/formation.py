"""How well the formation was kept: the true shape, and its distance from the noise-free run."""

from __future__ import annotations

import math

import numpy as np

from formation.angles import FloatArray, wrap
from hil.judge.columns import Columns, inside
from hil.judge.mocap_truth import slowest_travel
from hil.judge.noise_free_orbit import NoiseFreeOrbit, noise_free_orbit
from hil.judge.run_data import RunData, Span
from hil.judge.side_orders import desired_bearings


def judge_formation(run_data: RunData, columns: Columns) -> dict[str, object]:
    """The ``formation`` part of a summary, from the truth within the evaluation; empty without truth.

    ``equilibrium_deviation_rms`` from rho_0 and the alpha1 of the station, that of the side that was ordered
    last, where the law ``ideal`` settles.
    ``orbit_deviation_rms`` against :func:`orbit_of_run`.
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
    orbit = orbit_of_run(run_data, columns)
    if orbit is not None:
        orbit_rho, orbit_alpha1, _ = orbit.at(truth.capture_ns[known])
        result["orbit_deviation_rms"] = {
            "rho": _rms(rho - orbit_rho),
            "alpha1": _rms(wrap(alpha1 - orbit_alpha1)),
        }
    return result


def orbit_of_run(run_data: RunData, columns: Columns) -> NoiseFreeOrbit | None:
    """The noise-free run beside a run in which a leader set off; None for other recordings, or if not known.

    Where the tracks of a motion capture stand for the truth it begins when the leader is seen to move: a real
    one does so later than it was told.
    """
    scenario, truth, run = run_data.scenario, columns.truth, columns.run
    if run_data.motion_since_ns is None:
        return None
    if run_data.tracks is not None:
        moving = truth.capture_ns[inside(truth.capture_ns, run) & (truth.v1 > slowest_travel(scenario))]
        run = Span(int(moving[0]), run.to_ns) if len(moving) else run
    return noise_free_orbit(scenario, truth, run, run_data.orders)


def _rms(deviation: FloatArray) -> float:
    return math.sqrt(float(np.mean(deviation * deviation)))
