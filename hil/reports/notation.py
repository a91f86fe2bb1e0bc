"""How the pages write what other texts spell out: the paper's symbols, and angles in degrees."""

from __future__ import annotations

import re
from math import degrees

SYMBOLS = {
    "rho_dot": "ρ̇",
    "alpha2_dot": "α̇₂",
    "rho_min": "ρ_min",
    "rho_max": "ρ_max",
    "M_rho": "M_ρ",
    "M_alpha1": "M_α₁",
    "M_alpha2": "M_α₂",
    "E_rho": "E_ρ",
    "E_alpha2": "E_α₂",
    "rho_0": "ρ₀",
    "mu_rho": "μ_ρ",
    "rho": "ρ",
    "alpha1": "α₁",
    "alpha2": "α₂",
    "mu1": "μ₁",
    "mu2": "μ₂",
    "v1": "v₁",
    "u1": "u₁",
    "v2": "v₂",
    "u2": "u₂",
    "sigma": "σ",
}
"""Symbols of the paper by their names in code and JSON."""

_NUMBER = r"-?\d[\d.]*(?:e[+-]?\d+)?"
# Neither within the key of a scenario nor within the name of a file.
_NAME = re.compile(rf"(?<![\w.:/-])({'|'.join(SYMBOLS)})(?![\w:/]|\.\w)")
_RADIANS = re.compile(rf"({_NUMBER})((?: (?:to|and) {_NUMBER})?) rad\b(?! a second)")


def written(text: str) -> str:
    """A sentence with the symbols of the paper, and its angles in degrees.

    >>> written("|u1| <= k_u = 0.5 rad/s, alpha1 -2.2 to -0.8 rad, 0.07 m/s^2, set controller.mu2")
    '|u₁| ≤ k_u = 28.6 deg/s, α₁ -126 to -45.8 deg, 0.07 m/s², set controller.mu2'
    """
    turned = _RADIANS.sub(_in_degrees, text)
    named = _NAME.sub(lambda found: SYMBOLS[found[1]], turned)
    for plain, sign in (("<=", "≤"), (">=", "≥"), ("m/s^2", "m/s²")):
        named = named.replace(plain, sign)
    return named


def _in_degrees(found: re.Match[str]) -> str:
    numbers = re.sub(_NUMBER, lambda number: f"{degrees(float(number[0])):.3g}", found[1] + found[2])
    return f"{numbers} deg"
