"""The noise that an estimator found, and what is no longer guaranteed where an assumption is refuted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from estimation.bounds.certified import Failed
from hil.nodes.findings import Findings
from hil.nodes.leader_findings import LIMITS_BROKEN
from hil.nodes.noise_report import is_refuted

_FAILED = Failed.NOISE.value


def judge_noise(scale: float | None) -> dict[str, float]:
    """The ``noise`` part of a summary: ``scale``, of positions, found over told; empty where it is given."""
    return {} if scale is None else {"scale": scale}


def refuted(scale: float | None, found: Mapping[str, Findings]) -> str | None:
    """Which assumption of a certificate a run has refuted, by its noise and its nodes' findings, if any."""
    if is_refuted(scale):
        return f"positions scatter {scale:.2g} times as much as it assumes"
    beyond = next((each[LIMITS_BROKEN] for each in found.values() if LIMITS_BROKEN in each), None)
    return None if beyond is None else f"the leader goes beyond its limits: {beyond}"


def supported(certificate: Mapping[str, Any], why: str | None) -> Mapping[str, Any]:
    """A certificate's JSON, with the reason in place of figures where one of its assumptions is refuted."""
    if why is None:
        return certificate
    return {name: {"why": why, "assumes": claim.get("assumes", [])} for name, claim in certificate.items()}


def certain(certified: Mapping[str, Any], scale: float | None) -> Mapping[str, Any]:
    """The ``certified`` part of a summary; of noise that is refuted no radius is one."""
    if not is_refuted(scale) or not certified:
        return certified
    failed = dict(certified["failed"])
    failed[_FAILED] = failed.get(_FAILED, 0) + certified["certified"]
    return {"certified": 0, "failed": failed, "v1": {}, "alpha1": {}}


def noise_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    """That the noise exceeds what was told, and what follows from it."""
    scale = summary.get("noise", {}).get("scale")
    if is_refuted(scale):
        yield (
            f"positions scatter {scale:.2g} times as much as estimator.sigma_position says: estimates take "
            "that into account, bounds and certificate do not and guarantee nothing; set it to what "
            "abreast calibrate finds"
        )
