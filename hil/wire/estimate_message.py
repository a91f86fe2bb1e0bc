"""An estimate as it goes out: with its bounds, the reason against it, and receipts of what it rests on."""

from __future__ import annotations

from estimation.bounds.window_velocity import WindowVelocity
from estimation.tracking.estimate import Estimate, Joint
from formation.byte_access import write_float
from formation.kernel import kernel
from formation.records import Buffer, Rows
from hil.wire.assumed_errors import AssumedErrors, bounds_of
from hil.wire.cdr import STAMP_BYTES, aligned
from hil.wire.estimate_layout import COVARIANCE_AT, write_estimate
from hil.wire.records import EstimateNumbers, Receipt

_ROW_BYTES = 5 * 8


@kernel
def estimate_numbers(
    estimate: Estimate,
    window: WindowVelocity,
    assumed: AssumedErrors,
    reason: int,
    consumed: int,
    now_ns: int,
) -> EstimateNumbers:
    """Numbers of the message that tells an estimate at a time; ``window``: of the positions behind it."""
    bound = bounds_of(estimate, assumed, window)
    return EstimateNumbers(
        estimate.capture_ns,
        estimate.measured_ns,
        now_ns,
        estimate.status,
        reason,
        consumed,
        estimate.rho,
        estimate.alpha2,
        estimate.rho_dot,
        estimate.alpha2_dot,
        estimate.v1,
        estimate.alpha1,
        estimate.u1,
        estimate.v2,
        estimate.u2,
        estimate.nis,
        bound.v1,
        bound.alpha1,
        bound.h,
    )


@kernel(inline=False)
def write_estimate_message(
    buffer: Buffer,
    times_at: int,
    reasons: bytes,
    numbers: EstimateNumbers,
    joint: Joint,
    receipts: Rows[Receipt],
) -> int:
    """Fill :func:`hil.wire.templates.estimate_template`; returns the length."""
    at = aligned(times_at + 2 * STAMP_BYTES, 8) + COVARIANCE_AT
    j = joint
    _write_row(buffer, at, j.r_r, j.r_a, j.r_v, j.r_b, j.r_u)
    _write_row(buffer, at + _ROW_BYTES, j.r_a, j.a_a, j.a_v, j.a_b, j.a_u)
    _write_row(buffer, at + 2 * _ROW_BYTES, j.r_v, j.a_v, j.v_v, j.v_b, j.v_u)
    _write_row(buffer, at + 3 * _ROW_BYTES, j.r_b, j.a_b, j.v_b, j.b_b, j.b_u)
    _write_row(buffer, at + 4 * _ROW_BYTES, j.r_u, j.a_u, j.v_u, j.b_u, j.u_u)
    return write_estimate(buffer, times_at, reasons, numbers, receipts)


@kernel
def _write_row(buffer: Buffer, at: int, a: float, b: float, c: float, d: float, e: float) -> None:
    write_float(buffer, at, a)
    write_float(buffer, at + 8, b)
    write_float(buffer, at + 16, c)
    write_float(buffer, at + 24, d)
    write_float(buffer, at + 32, e)
