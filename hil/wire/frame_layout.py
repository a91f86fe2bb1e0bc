"""Mocap frames, ``mocap4r2_msgs/RigidBodies``, read from and written into bytes."""

from __future__ import annotations

from formation.byte_access import read_uint32, write_int32
from formation.kernel import kernel
from formation.records import Buffer, Indices, Rows, load, size, store
from hil.wire.body_walk import after_markers
from hil.wire.cdr import (
    HEAD_BYTES,
    PLACEMENT_BYTES,
    after_header,
    after_text,
    aligned,
    begin,
    ends,
    fits,
    read_placement,
    read_stamp,
    text_number,
    write_stamp,
)
from hil.wire.records import Body, FrameHead, Placement, Stamp

_NOWHERE = Placement(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel(inline=False)
def read_bodies(payload: bytes, names: bytes, bodies: Rows[Body]) -> FrameHead:
    """Read a frame; ``bodies`` gets what it says of each body in ``names``, in their order.

    ``names``: by :func:`hil.wire.cdr.packed_texts`, as many as there are ``bodies``.
    """
    for k in range(size(bodies)):
        store(bodies, k, Body(0, _NOWHERE))
    at = aligned(after_header(payload, begin(payload)), 4)
    if not fits(payload, at, 8):
        return FrameHead(False, Stamp(0, 0), 0, 0)
    stamp, frame_number = read_stamp(payload, HEAD_BYTES), read_uint32(payload, at)
    count, strangers = read_uint32(payload, at + 4), 0
    at += 8
    for _ in range(count):
        name_at = aligned(at, 4)
        at = aligned(after_markers(payload, after_text(payload, name_at)), 8)
        if not fits(payload, at, PLACEMENT_BYTES):
            return FrameHead(False, stamp, 0, 0)
        k = text_number(names, payload, name_at)
        if k < 0:
            strangers += 1
        else:
            known = load(Body, bodies, k)
            place = read_placement(payload, at) if known.seen == 0 else known.place
            store(bodies, k, Body(known.seen + 1, place))
        at += PLACEMENT_BYTES
    return FrameHead(ends(payload, at), stamp, frame_number, strangers)


@kernel
def write_frame_head(buffer: Buffer, places_at: Indices, capture_ns: int, frame_number: int) -> None:
    """Put stamp and number into a frame whose names stand there already, and whose poses are still to come.

    ``places_at``: position of the frame number, then of each body's pose, as
    :func:`hil.wire.templates.frame_template` has them.
    """
    write_stamp(buffer, HEAD_BYTES, capture_ns)
    write_int32(buffer, places_at[0], frame_number)
