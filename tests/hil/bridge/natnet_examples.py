"""NatNet by hand: models and frames with parts that our own writer does not send."""

from __future__ import annotations

import struct
from collections.abc import Callable

from hypothesis import strategies as st

from hil.bridge.datagram_reader import MalformedDatagramError
from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import Version

Int = struct.Struct("<i").pack
"""One number as a stream has it."""

FLOAT32 = st.floats(-100.0, 100.0, width=32)
POINTS = st.tuples(FLOAT32, FLOAT32, FLOAT32)
QUATERNIONS = st.tuples(FLOAT32, FLOAT32, FLOAT32, FLOAT32)
BODIES = st.lists(
    st.builds(Body, st.integers(-(2**31), 2**31 - 1), POINTS, QUATERNIONS, FLOAT32, st.booleans()), max_size=5
)
NAMES = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)


def cause_of(read: Callable[[], object]) -> str:
    """The cause by which something is refused, empty if it is read."""
    try:
        read()
    except MalformedDatagramError as error:
        return error.cause
    return ""


def section(version: Version, *items: bytes) -> bytes:
    """A section of a frame."""
    body = b"".join(items)
    return Int(len(items)) + (Int(len(body)) if version.sized else b"") + body


def floats(number: int) -> bytes:
    """Some floats, none of them zero."""
    return struct.pack(f"<{number}f", *(1.5 + k for k in range(number)))


def text(word: str) -> bytes:
    return word.encode() + b"\0"


def body_bytes(body: Body) -> bytes:
    return struct.pack("<i7ffh", body.id, *body.position, *body.orientation, body.error, int(body.tracked))


def full_frame(version: Version, bodies: list[Body], parameters: int, precision: bool = True) -> bytes:
    """The body of a frame that has something in every section; mid-exposure 11, received 12, sent 13."""
    bone = struct.pack("<i", 7) + floats(8) + struct.pack("<h", 1)
    channels = Int(5) + Int(2) + Int(1) + floats(1) + Int(3) + floats(3)
    assets = Int(4) + Int(1) + bone + Int(1) + Int(9) + floats(4) + struct.pack("<h", 1) + floats(1)
    labelled = Int(65_537) + floats(4) + struct.pack("<h", 2) + floats(1)
    parts = [
        Int(123),
        section(version, text("all") + Int(2) + floats(6), text("") + Int(0)),
        section(version, floats(3), floats(3)),
        section(version, *map(body_bytes, bodies)),
        section(version, Int(3) + Int(2) + bone + bone),
        section(version, assets) if version.sized else b"",
        section(version, labelled, labelled, labelled),
        section(version, channels),
        section(version, channels, Int(6) + Int(0)),
        struct.pack("<IIdQQQ", 1, 2, 3.5, 11, 12, 13),
        struct.pack("<II", 8, 9) if version.sized and precision else b"",
        struct.pack("<h", parameters),
        Int(0),
    ]
    return b"".join(parts)


def body_part(version: Version, number: int, name: str, markers: int = 2, bare: bool = False) -> bytes:
    """What a model says of a rigid body, or of a bone that has no markers listed."""
    told = text(name) + struct.pack("<ii", number, -1) + floats(3)
    if bare:
        return told
    told += Int(markers) + floats(3 * markers) + Int(0) * markers
    return told + text("marker") * markers if version.major >= 4 else told


def full_model(version: Version, names: dict[int, str], bare_bones: bool = False) -> bytes:
    """The body of a model with a part of every kind."""
    bones = b"".join(body_part(version, k, f"bone{k}", bare=bare_bones) for k in (1, 2))
    plate = (
        Int(1)
        + text("serial")
        + floats(2 + 3 + 144 + 12)
        + Int(0)
        + Int(1)
        + Int(2)
        + text("Fx")
        + text("Fy")
    )
    device = Int(2) + text("NIDAQ") + text("serial") + Int(3) + Int(1) + Int(1) + text("channel")
    parts = [
        (0, text("all") + Int(2) + text("a") + text("b")),
        *((1, body_part(version, number, name)) for number, name in names.items()),
        (2, text("skeleton") + Int(9) + Int(2) + bones),
        (3, plate),
        (4, device),
        (5, text("Prime 13") + floats(7)),
    ]
    if version.sized:
        parts.append((6, text("asset") + floats(9)))
    told = [Int(kind) + (Int(len(part)) if version.sized else b"") + part for kind, part in parts]
    return Int(len(parts)) + b"".join(told)
