"""Compiled ways to and from payloads that only tests and benchmarks take, for all layouts in one manner."""

from __future__ import annotations

from formation.byte_access import read_float, write_float
from formation.kernel import entry
from formation.records import Buffer, Indices, Rows, Vector, borrowed, load, store
from hil.wire import command_layout, estimate_layout, frame_layout, odometry_layout
from hil.wire.cdr import STAMP_BYTES, aligned, write_placement
from hil.wire.message_checks import is_estimate
from hil.wire.records import (
    Body,
    CommandNumbers,
    EstimateNumbers,
    Odometry,
    ReadCommand,
    ReadTruth,
    Receipt,
    TruthNumbers,
)

_COVARIANCE = 25


@entry
def write_frame(
    buffer: Buffer, places_at: Indices, capture_ns: int, frame_number: int, bodies: Rows[Body]
) -> None:
    """Fill :func:`hil.wire.templates.frame_template`."""
    frame_layout.write_frame_head(buffer, places_at, capture_ns, frame_number)
    for k in range(len(places_at) - 1):
        write_placement(buffer, places_at[k + 1], load(Body, borrowed(bodies), k).place)


@entry
def read_odometry(payload: bytes) -> Odometry:
    """Read all that a robot tells of itself, unchecked."""
    return odometry_layout.read_odometry(payload)


@entry
def write_odometry(buffer: Buffer, numbers_at: int, stamp_ns: int, odometry: Odometry) -> None:
    """Fill :func:`hil.wire.templates.odometry_template`."""
    odometry_layout.write_odometry(buffer, numbers_at, stamp_ns, odometry)


@entry
def take_estimate(payload: bytes, estimates: Rows[EstimateNumbers], covariance: Vector) -> bool:
    """Read an estimate into the first row and 25 numbers; whether it is one."""
    read = estimate_layout.read_estimate(payload)
    if not is_estimate(read):
        return False
    store(borrowed(estimates), 0, read.numbers)
    for k in range(_COVARIANCE):
        covariance[k] = read_float(payload, read.covariance_at + 8 * k)
    return True


@entry
def write_estimate(
    buffer: Buffer,
    times_at: int,
    reasons: bytes,
    estimates: Rows[EstimateNumbers],
    covariance: Vector,
    receipts: Rows[Receipt],
) -> int:
    """Fill :func:`hil.wire.templates.estimate_template` from the first row; returns the length."""
    at = aligned(times_at + 2 * STAMP_BYTES, 8) + estimate_layout.COVARIANCE_AT
    for k in range(_COVARIANCE):
        write_float(buffer, at + 8 * k, covariance[k])
    numbers = load(EstimateNumbers, borrowed(estimates), 0)
    return estimate_layout.write_estimate(buffer, times_at, reasons, numbers, borrowed(receipts))


@entry
def write_command(
    buffer: Buffer, times_at: int, stops: bytes, commands: Rows[CommandNumbers], receipts: Rows[Receipt]
) -> int:
    """Fill :func:`hil.wire.templates.command_template` from the first row; returns the length."""
    numbers = load(CommandNumbers, borrowed(commands), 0)
    return command_layout.write_command(buffer, times_at, stops, numbers, borrowed(receipts))


@entry
def write_truth(buffer: Buffer, number_at: int, truths: Rows[TruthNumbers]) -> None:
    """Fill :func:`hil.wire.templates.truth_template` from the first row."""
    command_layout.write_truth(buffer, number_at, load(TruthNumbers, borrowed(truths), 0))


@entry
def read_command(payload: bytes, stops: bytes) -> ReadCommand:
    """Read a decision, unchecked but for its stamps."""
    return command_layout.read_command(payload, stops)


@entry
def read_truth(payload: bytes) -> ReadTruth:
    """Read true states, unchecked."""
    return command_layout.read_truth(payload)
