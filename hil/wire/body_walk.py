"""The bodies of a mocap frame, walked through byte by byte; what a robot's guard sees of a frame."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.byte_access import read_uint32
from formation.kernel import kernel
from hil.wire.cdr import (
    PLACEMENT_BYTES,
    after_header,
    after_text,
    aligned,
    begin,
    ends,
    fits,
    read_placement,
)

_POINT_BYTES = 24


class Spot(NamedTuple):
    """Where a body is: its name, and its position in the plane [m]."""

    body: str
    x: float
    y: float


def spots_in(payload: bytes) -> tuple[Spot, ...]:
    """The bodies of a ``mocap4r2_msgs/RigidBodies``, those without a finite position left out.

    A payload that is no such message has none.
    """
    at = aligned(after_header(payload, begin(payload)), 4)
    if not fits(payload, at, 8):
        return ()
    spots = []
    count = read_uint32(payload, at + 4)
    at += 8
    for _ in range(count):
        name_at = aligned(at, 4)
        name_end = after_text(payload, name_at)
        at = aligned(after_markers(payload, name_end), 8)
        if not fits(payload, at, PLACEMENT_BYTES):
            return ()
        place = read_placement(payload, at)
        if math.isfinite(place.x) and math.isfinite(place.y):
            spots.append(Spot(payload[name_at + 4 : name_end - 1].decode(), place.x, place.y))
        at += PLACEMENT_BYTES
    return tuple(spots) if ends(payload, at) else ()


@kernel
def after_markers(payload: bytes, at: int) -> int:
    """Position after a sequence of markers, -1 if there is none; nobody looks at them."""
    at = aligned(at, 4)
    if not fits(payload, at, 4):
        return -1
    count = read_uint32(payload, at)
    at += 4
    for _ in range(count):
        # The type of the id, a byte, then the index, aligned to four.
        at = aligned(at + 1, 4) + 4
        at = aligned(after_text(payload, at), 8)
        if not fits(payload, at, _POINT_BYTES):
            return -1
        at += _POINT_BYTES
    return at
