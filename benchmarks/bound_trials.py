"""Random moments with random errors within given bounds, half of them with every error on its bound."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.bounds.bound_check import SpeedInputs, Verdict, all_bounds, check, errors_of
from estimation.bounds.error_bounds import InputErrors, Perceived, RateErrors
from formation.angles import FloatArray
from formation.spacing import Spacing
from formation.station import ABREAST, Station


@dataclass(frozen=True, slots=True)
class Setting:
    """Gain mu1 and spacing of an experiment, its leader's speed v1 and floor v_eps, and the station."""

    mu1: float
    spacing: Spacing
    v1: float
    v_eps: float
    station: Station = ABREAST


FIG2 = Setting(1.0, Spacing(0.5, 2.0), 0.5, 0.4)
TURTLEBOT3 = Setting(1.5, Spacing(0.2, 20.0), 0.08, 0.06)
LEVELS = (0.01, 0.05, 0.2, 0.8)
"""Noise levels: the largest errors, as shares of the speed, the distance or a radian."""


class _Errors:
    """Draws errors within given bounds; for half of the samples every error lies on its bound."""

    def __init__(self, random: np.random.Generator, size: int) -> None:
        self._random, self._size = random, size
        self._on_edge = random.random(size) < 0.5

    def bound(self, scale: float) -> FloatArray:
        """Error bounds spread over three decades up to the scale, so that any of them can dominate."""
        return scale * 10.0 ** self._random.uniform(-3.0, 0.0, self._size)

    def within(self, bound: FloatArray) -> FloatArray:
        """An error each."""
        part = self._random.uniform(-1.0, 1.0, self._size)
        return bound * np.where(self._on_edge, np.sign(part), part)


def judge_trials(
    setting: Setting, level: float, random: np.random.Generator, samples: int, *, input_errors: bool
) -> Verdict:
    """Verdict on every named bound over random moments, whose largest errors are of a noise level.

    ``input_errors``: rho, alpha2, v2 and u2 err too, as the extended forms admit; else only the rates do.
    """
    draw, uniform = _Errors(random, samples), random.uniform
    rho_0, v = setting.spacing.rho_0, setting.v1
    truth = SpeedInputs(
        rho_0 * uniform(0.5, 4.0, samples),
        uniform(setting.v_eps, 2.0 * v - setting.v_eps, samples),
        uniform(-math.pi, math.pi, samples),
    )
    alpha2, v2 = uniform(-math.pi, math.pi, samples), v * uniform(-0.5, 3.0, samples)
    u2 = uniform(-2.0, 2.0, samples)
    rho_dot = -truth.v1 * np.cos(truth.alpha1) - v2 * np.cos(alpha2)
    alpha2_dot = -u2 + (truth.v1 * np.sin(truth.alpha1) + v2 * np.sin(alpha2)) / truth.rho

    rates = RateErrors(draw.bound(level * v), draw.bound(level * v / rho_0))
    scales = (level * rho_0, level, level * v, level) if input_errors else (0.0,) * 4
    E_rho, E_alpha2, E_v2, E_u2 = (draw.bound(scale) for scale in scales)
    perceived = Perceived.from_rates(
        truth.rho + draw.within(E_rho),
        alpha2 + draw.within(E_alpha2),
        rho_dot + draw.within(np.asarray(rates.M_rho)),
        alpha2_dot + draw.within(np.asarray(rates.M_alpha2)),
        v2 + draw.within(E_v2),
        u2 + draw.within(E_u2),
    )
    bounds = all_bounds(
        perceived,
        rates,
        InputErrors(E_rho, E_alpha2, E_v2, E_u2),
        v_eps=setting.v_eps,
        mu1=setting.mu1,
        spacing=setting.spacing,
        station=setting.station,
    )
    return check(errors_of(perceived, truth, setting.mu1, setting.spacing, setting.station), bounds)
