"""Compiled ways from payloads to records and back, for Python. Importing this module compiles them.

Compiled steps of nodes call the kernels of ``*_layout`` and :mod:`hil.wire.message_checks` instead. Records
of many fields lie in rows of the caller's, as to hand Python twenty numbers takes longer than to read them.
"""

from __future__ import annotations

from estimation.bounds.window_velocity import WindowVelocity
from estimation.tracking.estimate import Estimate
from formation.kernel import entry
from formation.records import Buffer, Rows, borrowed, load, store
from hil.wire import drive_layout, frame_layout, odometry_layout
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.estimate_message import estimate_numbers, write_estimate_message
from hil.wire.message_checks import check_frame, check_odometry, check_sighting
from hil.wire.records import (
    Body,
    CheckedMotion,
    Drive,
    Frame,
    FrameHead,
    Receipt,
    Sighting,
    Wanted,
)


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
def take_odometry(payload: bytes, latest_ns: int) -> CheckedMotion:
    """Read a robot's own motion and check it."""
    return check_odometry(odometry_layout.read_odometry(payload), latest_ns)


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
def write_estimate(
    buffer: Buffer,
    times_at: int,
    reasons: bytes,
    estimates: Rows[Estimate],
    assumed: Rows[AssumedErrors],
    reason: int,
    now_ns: int,
    receipts: Rows[Receipt],
    consumed: int,
) -> int:
    """Fill :func:`hil.wire.templates.estimate_template` with an estimate; returns the length.

    ``estimates``, ``assumed``: one row. ``reason``: its number among ``reasons``. ``consumed``: how many of
    the receipts are meant. No window of positions stands behind it.
    """
    estimate, known = load(Estimate, estimates, 0), load(AssumedErrors, assumed, 0)
    window = WindowVelocity(0.0, 0.0, 0.0, 0.0, 0.0, False)
    numbers = estimate_numbers(estimate, window, known, reason, consumed, now_ns)
    return write_estimate_message(buffer, times_at, reasons, numbers, estimate.joint, borrowed(receipts))
