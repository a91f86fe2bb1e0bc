"""Estimates as a CSV file, one row for each, for whatever a lab plots with."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path

from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from hil.errors import UsageError
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import to_ns

FIELDS = (
    "t",
    "rho",
    "alpha2",
    *QUANTITIES,
    *(f"sd_{name}" for name in QUANTITIES),
    "bound_v1",
    "bound_alpha1",
    "status",
)


def write_estimates(estimates: Iterable[LeaderEstimate], path: Path) -> None:
    """Write estimates in their order, numbers to full precision; what is not known is left empty.

    ``t`` is the capture time [s], exact to the nanosecond; ``sd_`` are standard deviations. Raises
    :class:`UsageError` if the file cannot be written.
    """
    try:
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(FIELDS)
            writer.writerows(_row(estimate) for estimate in estimates)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); give another place") from None


def _row(estimate: LeaderEstimate) -> list[str]:
    variances = estimate.covariance.reshape(5, 5).diagonal().tolist()
    numbers = [
        estimate.rho,
        estimate.alpha2,
        *(getattr(estimate, name) for name in QUANTITIES),
        *(math.sqrt(variance) if variance >= 0.0 else math.nan for variance in variances),
        estimate.bound_v1,
        estimate.bound_alpha1,
    ]
    seconds, rest = divmod(to_ns(estimate.header.stamp), 1_000_000_000)
    texts = ["" if math.isnan(number) else repr(float(number)) for number in numbers]
    return [f"{seconds}.{rest:09d}", *texts, Status(estimate.status).name.lower()]
