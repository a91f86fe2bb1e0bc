"""Compiled ways from payloads to records and back, for Python. Importing this module compiles them.

Compiled steps of nodes call the kernels of ``*_layout`` and :mod:`hil.wire.message_checks` instead. Records
of many fields lie in rows of the caller's, as to hand Python twenty numbers takes longer than to read them.
"""

from __future__ import annotations

from estimation.tracking.estimate import Estimate
from formation.kernel import entry
from formation.records import Buffer, Indices, Rows, Vector, borrowed, load, read_float, store
from hil.wire import command_layout, drive_layout, estimate_layout, frame_layout, odometry_layout
from hil.wire.estimate_message import AssumedErrors
from hil.wire.message_checks import ACCEPTED, check_frame, check_odometry, check_sighting, estimate_cause
from hil.wire.records import (
    Body,
    CheckedMotion,
    CommandNumbers,
    Drive,
    EstimateNumbers,
    Frame,
    FrameHead,
    Odometry,
    Receipt,
    Sighting,
    TruthNumbers,
    Wanted,
)
from hil.wire.told_estimate import told_numbers, write_told

_COVARIANCE = 25


@entry
def take_frame(
    payload: bytes, names: bytes, heads: Rows[FrameHead], bodies: Rows[Body], wanted: Rows[Wanted]
) -> Frame:
    """Read a mocap frame, keep its head and its bodies, and check it for a pair.

    ``names``: by :func:`hil.wire.cdr.packed_texts`, as many as there are ``bodies``. ``heads``, ``wanted``:
    one row.
    """
    rows = borrowed(bodies)
    head = frame_layout.read_bodies(payload, names, rows)
    store(borrowed(heads), 0, head)
    return check_frame(head, rows, load(Wanted, borrowed(wanted), 0))


@entry
def look_again(heads: Rows[FrameHead], bodies: Rows[Body], wanted: Rows[Wanted]) -> Frame:
    """Check for another pair the frame that :func:`take_frame` has kept."""
    head = load(FrameHead, borrowed(heads), 0)
    return check_frame(head, borrowed(bodies), load(Wanted, borrowed(wanted), 0))


@entry
def write_frame(
    buffer: Buffer, places_at: Indices, capture_ns: int, frame_number: int, bodies: Rows[Body]
) -> None:
    """Fill :func:`hil.wire.templates.frame_template`."""
    frame_layout.write_frame(buffer, places_at, capture_ns, frame_number, borrowed(bodies))


@entry
def take_odometry(payload: bytes, latest_ns: int) -> CheckedMotion:
    """Read a robot's own motion and check it."""
    return check_odometry(odometry_layout.read_odometry(payload), latest_ns)


@entry
def read_odometry(payload: bytes) -> Odometry:
    """Read all that a robot tells of itself, unchecked."""
    return odometry_layout.read_odometry(payload)


@entry
def write_odometry(buffer: Buffer, numbers_at: int, stamp_ns: int, told: Odometry) -> None:
    """Fill :func:`hil.wire.templates.odometry_template`."""
    odometry_layout.write_odometry(buffer, numbers_at, stamp_ns, told)


@entry
def take_sighting(payload: bytes, latest_ns: int) -> Sighting:
    """Read a sighting of the leader and check it."""
    return check_sighting(odometry_layout.read_sighting(payload), latest_ns)


@entry
def read_drive(payload: bytes, stamped: bool) -> Drive:
    """Read a drive command, unchecked."""
    return drive_layout.read_drive(payload, stamped)


@entry
def write_drive(buffer: Buffer, twist_at: int, stamp_ns: int, v: float, u: float) -> None:
    """Fill :func:`hil.wire.templates.drive_template`."""
    drive_layout.write_drive(buffer, twist_at, stamp_ns, v, u)


@entry
def take_estimate(
    payload: bytes, latest_ns: int, estimates: Rows[EstimateNumbers], covariance: Vector
) -> int:
    """Read an estimate into the first row and 25 numbers, and check it; returns the cause against it."""
    read = estimate_layout.read_estimate(payload)
    cause = estimate_cause(read, latest_ns)
    if cause == ACCEPTED:
        store(borrowed(estimates), 0, read.numbers)
        for k in range(_COVARIANCE):
            covariance[k] = read_float(payload, read.covariance_at + 8 * k)
    return cause


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
    estimate_layout.write_covariance(buffer, times_at, covariance)
    numbers = load(EstimateNumbers, borrowed(estimates), 0)
    return estimate_layout.write_estimate(buffer, times_at, reasons, numbers, borrowed(receipts))


@entry
def tell_estimate(
    buffer: Buffer,
    times_at: int,
    reasons: bytes,
    told: Rows[Estimate],
    assumed: Rows[AssumedErrors],
    reason: int,
    now_ns: int,
    receipts: Rows[Receipt],
    consumed: int,
) -> int:
    """Fill :func:`hil.wire.templates.estimate_template` with an estimate; returns the length.

    ``told``, ``assumed``: one row. ``reason``: its number among ``reasons``. ``consumed``: how many of the
    receipts are meant.
    """
    estimate = load(Estimate, told, 0)
    numbers = told_numbers(estimate, load(AssumedErrors, assumed, 0), reason, consumed, now_ns)
    return write_told(buffer, times_at, reasons, numbers, estimate.joint, borrowed(receipts))


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
