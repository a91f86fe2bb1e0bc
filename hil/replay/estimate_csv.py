"""Estimates as a CSV file, one row for each, for whatever a lab plots with."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from hil.errors import UsageError
from hil.log.written_aside import written_aside
from hil.replay.estimate_columns import ESTIMATE_COLUMNS
from hil.replay.kept import Array
from hil.replay.kept_rows import EstimateRow, estimate_row
from hil.wire.estimate_layout import read_estimate
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import encode


def write_estimates(estimates: Iterable[LeaderEstimate] | Array, path: Path) -> None:
    """Write estimates in their order, numbers to full precision; what is not known is left empty.

    ``estimates``: messages, or rows of :class:`hil.replay.kept_rows.EstimateRow`. ``t`` is the capture time
    [s], exact to the nanosecond; ``sd_`` are standard deviations. Raises :class:`UsageError` if the file
    cannot be written.
    """
    rows: Iterable[EstimateRow]
    if isinstance(estimates, np.ndarray):
        rows = (EstimateRow._make(row.item()) for row in estimates)
    else:
        rows = map(_row_of, estimates)
    try:
        with written_aside(path) as aside, aside.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(ESTIMATE_COLUMNS)
            writer.writerows(map(_cells, rows))
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); give another place") from None


def _row_of(message: LeaderEstimate) -> EstimateRow:
    payload = encode(message)
    read = read_estimate(payload)
    return estimate_row(read.numbers, payload, read.covariance_at)


def _cells(row: EstimateRow) -> list[str]:
    variances = [getattr(row, f"var_{name}") for name in QUANTITIES]
    numbers = [
        row.rho,
        row.alpha2,
        *(getattr(row, name) for name in QUANTITIES),
        *(math.sqrt(variance) if variance >= 0.0 else math.nan for variance in variances),
        row.bound_v1,
        row.bound_alpha1,
    ]
    seconds, rest = divmod(row.capture_ns, 1_000_000_000)
    texts = ["" if math.isnan(number) else repr(float(number)) for number in numbers]
    return [f"{seconds}.{rest:09d}", *texts, Status(row.status).name.lower()]
