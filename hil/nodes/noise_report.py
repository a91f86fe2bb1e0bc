"""What an estimator says of the noise that it finds: values of its diagnostics, and the finding."""

from __future__ import annotations

from collections.abc import Mapping

from estimation.consistency.noise_estimate import REFUTED, NoiseEstimate, NoiseLearning, scaled_noise

NOISE_SCALE = "noise.scale"
"""Value of an estimator's diagnostics: standard deviation of positions as found over what is told."""

_DIGITS = 3


def scale_of(estimate: NoiseEstimate, learning: NoiseLearning) -> float | None:
    """Scale of the noise of positions, to the digits that diagnostics have; None where it is given."""
    return round(estimate.scale.position, _DIGITS) if learning.learns else None


def scale_in(values: Mapping[str, str]) -> float | None:
    """The same out of the diagnostics of an estimator; None where they lack it or hold something else."""
    try:
        return float(values[NOISE_SCALE])
    except (KeyError, ValueError):
        return None


def is_refuted(scale: float | None) -> bool:
    """Whether what is told of the noise is refuted, and with it all bounds that rest on it."""
    return scale is not None and scale > REFUTED


def noise_report(estimate: NoiseEstimate, learning: NoiseLearning) -> dict[str, object]:
    """Diagnostics of the noise; empty where it is given."""
    if not learning.learns:
        return {}
    scale, found = estimate.scale, scaled_noise(learning.told, estimate)
    return {
        NOISE_SCALE: scale_of(estimate, learning),
        "noise.scale_heading": round(scale.heading, _DIGITS),
        "noise.sigma_position": f"{found.position:.3g}",
        "noise.sigma_heading": f"{found.heading:.3g}",
    }


def noise_findings(estimate: NoiseEstimate, learning: NoiseLearning) -> dict[str, str]:
    """That the noise exceeds what is told by more than is certain, in a line; empty if it does not."""
    scale, told = estimate.scale, learning.told
    seen = [
        f"{name} scatters by {ratio * sigma * 1e3:.2g} {unit}, expected {sigma * 1e3:.2g} by estimator.{key}"
        for name, key, ratio, sigma, unit in (
            ("position", "sigma_position", scale.position, told.position, "mm"),
            ("heading", "sigma_heading", scale.heading, told.heading, "mrad"),
        )
        if learning.learns and ratio > REFUTED
    ]
    return {"noise": "; ".join(seen)} if seen else {}
