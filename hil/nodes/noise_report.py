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


def noise_report(estimate: NoiseEstimate, learning: NoiseLearning) -> dict[str, object]:
    """Diagnostics of the noise, with a finding where it exceeds what is told; empty where it is given."""
    if not learning.learns:
        return {}
    scale, found = estimate.scale, scaled_noise(learning.told, estimate)
    values: dict[str, object] = {
        NOISE_SCALE: scale_of(estimate, learning),
        "noise.scale_heading": round(scale.heading, _DIGITS),
        "noise.sigma_position": f"{found.position:.3g}",
        "noise.sigma_heading": f"{found.heading:.3g}",
    }
    if exceeding := noise_finding(estimate, learning):
        values["finding.noise"] = exceeding
    return values


def noise_finding(estimate: NoiseEstimate, learning: NoiseLearning) -> str:
    """That the noise exceeds what is told by more than is certain, in a line; empty if it does not."""
    scale, told = estimate.scale, learning.told
    seen = [
        f"{name} scatters by {ratio * sigma * by:.2g} {unit}, estimator.{key} says {sigma * by:.2g} {unit}"
        for name, key, ratio, sigma, by, unit in (
            ("position", "sigma_position", scale.position, told.position, 1e3, "mm"),
            ("heading", "sigma_heading", scale.heading, told.heading, 1e3, "mrad"),
        )
        if ratio > REFUTED
    ]
    return "; ".join(seen)
