"""Certified estimates as messages."""

from __future__ import annotations

import math

from estimation.bounds.certified import Certain, Failed
from estimation.tracking.estimate import Estimate
from hil.wire.message_types import CertifiedEstimate
from hil.wire.messages import header, to_time


def certified_message(
    estimate: Estimate, certain: Certain | Failed, now_ns: int, frame_id: str
) -> CertifiedEstimate:
    """Message of an estimate made at ``now_ns``, with its radii by what is certain at its time."""
    radius_v1, radius_alpha1, measurements, failed = math.nan, math.nan, 0, ""
    if isinstance(certain, Failed):
        failed = certain.value
    else:
        radius_v1 = certain.v1.radius(estimate.v1)
        radius_alpha1 = certain.alpha1.radius(estimate.alpha1, on_circle=True)
        measurements = certain.measurements
    return CertifiedEstimate(
        header=header(estimate.capture_ns, frame_id),
        computed=to_time(now_ns),
        v1=estimate.v1,
        radius_v1=radius_v1,
        alpha1=estimate.alpha1,
        radius_alpha1=radius_alpha1,
        measurements=measurements,
        failed=failed,
    )
