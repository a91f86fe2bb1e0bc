"""The verdict on certified estimates: how far their radii reach, and whether any error exceeds one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray, wrap
from hil.judge.run_data import Span
from hil.judge.true_states import Stamps, TrueStates
from hil.wire.message_types import CertifiedEstimate
from hil.wire.messages import to_ns


@dataclass(frozen=True, slots=True, eq=False)
class CertifiedColumns:
    """Certified estimates as arrays of shape (n,); a radius is NaN where ``failed`` names an assumption."""

    capture_ns: Stamps
    v1: FloatArray
    radius_v1: FloatArray
    alpha1: FloatArray
    radius_alpha1: FloatArray
    failed: NDArray[np.str_]

    @staticmethod
    def of(certified: Sequence[CertifiedEstimate], span: Span) -> CertifiedColumns:
        """Columns of the messages whose capture lies within a span, in their order."""
        stamped = [(to_ns(each.header.stamp), each) for each in certified]
        kept = [(at, each) for at, each in stamped if span.from_ns <= at <= span.to_ns]
        rows = [(each.v1, each.radius_v1, each.alpha1, each.radius_alpha1) for _, each in kept]
        v1, radius_v1, alpha1, radius_alpha1 = np.array(rows, dtype=np.float64).reshape(-1, 4).T
        return CertifiedColumns(
            capture_ns=np.array([at for at, _ in kept], dtype=np.int64),
            v1=v1,
            radius_v1=radius_v1,
            alpha1=alpha1,
            radius_alpha1=radius_alpha1,
            failed=np.array([each.failed for _, each in kept], dtype=np.str_),
        )


def judge_certified(certified: Sequence[CertifiedEstimate], truth: TrueStates, span: Span) -> dict[str, Any]:
    """The ``certified`` part of a summary, of all certified estimates within a span; empty without any.

    ``certified``: how many have radii; ``failed``: how many do not, by the assumption that failed. Per
    quantity v1 [m/s] and alpha1 [rad] the median and the largest radius; where the truth is known, how many
    errors exceed theirs (none may) and the largest error / radius.
    """
    columns = CertifiedColumns.of(certified, span)
    if not len(columns.capture_ns):
        return {}
    true = truth.at(columns.capture_ns)
    has = np.isfinite(columns.radius_v1)
    turned = np.asarray(wrap(np.asarray(columns.alpha1 - true.alpha1)))
    return {
        "certified": int(np.count_nonzero(has)),
        "failed": dict(Counter(columns.failed[~has].tolist())),
        "v1": _verdict(columns.radius_v1[has], np.abs(columns.v1 - true.v1)[has]),
        "alpha1": _verdict(columns.radius_alpha1[has], np.abs(turned)[has]),
    }


def certified_violations(summary: Mapping[str, Any]) -> dict[str, int]:
    """Quantities whose certified radii were violated, such as v1_certified, with the number of samples."""
    parts = {name: summary.get("certified", {}).get(name, {}) for name in ("v1", "alpha1")}
    return {f"{name}_certified": part["violations"] for name, part in parts.items() if part.get("violations")}


def _verdict(radius: FloatArray, error: FloatArray) -> Mapping[str, float]:
    if not len(radius):
        return {}
    figures = {"median": float(np.median(radius)), "largest": float(np.max(radius))}
    judged = np.isfinite(error)
    if not np.any(judged):
        return figures
    ratio = error[judged] / np.maximum(radius[judged], 1e-12)
    return figures | {"violations": int(np.count_nonzero(ratio > 1.0)), "tightness": float(np.max(ratio))}
