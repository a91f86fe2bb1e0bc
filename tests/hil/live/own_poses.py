"""How far robots were off the noise-free run by their own poses, which nobody else was told."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from formation.angles import wrap
from hil.judge.noise_free_orbit import noise_free_orbit
from hil.judge.run_data import Span
from hil.judge.true_states import TrueStates
from hil.scenario.schema import Scenario


def off_orbit(table: Path, scenario: Scenario, judged_s: tuple[float, float]) -> tuple[float, float]:
    """RMS of rho [m] and alpha1 [rad] off the noise-free run that began when the leader did.

    ``table``: rows of time [s], both poses, the leader's v and u, as
    :mod:`tests.hil.live.stranger_lab` leaves them. ``judged_s``: from when to when after the start [s].
    """
    rows = np.loadtxt(table, delimiter=",")
    driving = np.flatnonzero(np.abs(rows[:, 7]) > 0.01)
    rows = rows[driving[0] :]
    rows = rows[rows[:, 0] <= rows[0, 0] + judged_s[1]]
    moments = np.rint(rows[:, 0] * 1e9).astype(np.int64)
    nothing = np.zeros((len(rows), 2))
    truth = TrueStates.along(moments, np.column_stack([rows[:, 1:7], rows[:, 7:9], nothing]))
    orbit = noise_free_orbit(scenario, truth, Span(int(moments[0]), int(moments[-1])))
    assert orbit is not None
    judged = moments - moments[0] >= judged_s[0] * 1e9
    rho, alpha1, _ = orbit.at(moments[judged])
    off_rho = truth.rho[judged] - rho
    off_alpha1 = np.asarray(wrap(truth.alpha1[judged] - alpha1))
    return math.sqrt(float(np.mean(off_rho**2))), math.sqrt(float(np.mean(off_alpha1**2)))
