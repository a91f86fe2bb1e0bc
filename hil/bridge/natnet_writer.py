"""NatNet's model definition and frames of data as a server sends them: rigid bodies to bytes."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import Kind, Version, packet

_NUMBER = struct.Struct("<i")
_PLACED = struct.Struct("<ii3f")
_POINT = struct.Struct("<3f")
_BODY = struct.Struct("<i7ffh")
_LABELLED = struct.Struct("<i3ffhf")
_TIMES = struct.Struct("<IIdQQQ")
_PRECISION_TIME = struct.Struct("<II")
_PARAMETERS = struct.Struct("<h")

_NO_PARENT = -1
_MARKERS = ((0.05, 0.0, 0.0), (-0.04, 0.03, 0.0), (-0.04, -0.03, 0.0))
"""Where the markers of every body sit on it [m]."""

_MARKER_SIZE = 0.014
_TRACKED = 1
_SEEN_ON_MODEL = 0x0A
_MARKER_SET, _RIGID_BODY = 0, 1


def model_packet(names: Sequence[str], version: Version) -> bytes:
    """The model: a marker set and a rigid body for each name; their streaming ids count from 1."""
    parts = [_part(_MARKER_SET, _marker_set(name), version) for name in names]
    parts += [_part(_RIGID_BODY, _body(k, name, version), version) for k, name in enumerate(names, start=1)]
    return packet(Kind.MODEL, _NUMBER.pack(len(parts)) + b"".join(parts))


def frame_packet(
    number: int, names: Sequence[str], bodies: Sequence[Body], ticks: tuple[int, int, int], seconds: float,
    version: Version,
) -> bytes:  # fmt: skip
    """A frame: bodies of these names, with their markers.

    ``ticks``: the server's clock in the middle of the exposure, when the images had come, and at sending;
    ``seconds``: since the stream began.
    """
    markers = [_markers_of(body) for body in bodies]
    sets = [
        _text(name) + _NUMBER.pack(len(points)) + b"".join(_POINT.pack(*point) for point in points)
        for name, points in zip(names, markers, strict=True)
    ]
    placed = [
        _BODY.pack(body.id, *body.position, *body.orientation, body.error, _TRACKED if body.tracked else 0)
        for body in bodies
    ]
    labelled = [
        _LABELLED.pack((body.id << 16) + k, *point, _MARKER_SIZE, _SEEN_ON_MODEL, body.error)
        for body, points in zip(bodies, markers, strict=True)
        for k, point in enumerate(points, start=1)
    ]
    nothing = _section((), version)
    assets = nothing if version.sized else b""
    times = _TIMES.pack(0, 0, seconds, *ticks) + (_PRECISION_TIME.pack(0, 0) if version.sized else b"")
    sections = [
        _section(sets, version), nothing, _section(placed, version), nothing, assets,
        _section(labelled, version), nothing, nothing,
    ]  # fmt: skip
    end = _PARAMETERS.pack(0) + _NUMBER.pack(0)
    return packet(Kind.FRAME, _NUMBER.pack(number) + b"".join(sections) + times + end)


def _section(items: Sequence[bytes], version: Version) -> bytes:
    body = b"".join(items)
    size = _NUMBER.pack(len(body)) if version.sized else b""
    return _NUMBER.pack(len(items)) + size + body


def _part(kind: int, body: bytes, version: Version) -> bytes:
    size = _NUMBER.pack(len(body)) if version.sized else b""
    return _NUMBER.pack(kind) + size + body


def _marker_set(name: str) -> bytes:
    return _text(name) + _NUMBER.pack(len(_MARKERS)) + b"".join(map(_text, _marker_names()))


def _body(number: int, name: str, version: Version) -> bytes:
    # Some clients add the offset in the model to every position, so there is none.
    body = _text(name) + _PLACED.pack(number, _NO_PARENT, 0.0, 0.0, 0.0) + _NUMBER.pack(len(_MARKERS))
    body += b"".join(_POINT.pack(*point) for point in _MARKERS) + _NUMBER.pack(0) * len(_MARKERS)
    return body + b"".join(map(_text, _marker_names())) if version.major >= 4 else body


def _marker_names() -> list[str]:
    return [f"Marker{k}" for k in range(1, len(_MARKERS) + 1)]


def _markers_of(body: Body) -> list[tuple[float, float, float]]:
    """Where the markers of a body are."""
    x, y, z, w = body.orientation
    points = []
    for px, py, pz in _MARKERS:
        # v + 2 w (q x v) + 2 q x (q x v), for a unit quaternion of vector q.
        cx, cy, cz = y * pz - z * py, z * px - x * pz, x * py - y * px
        dx, dy, dz = y * cz - z * cy, z * cx - x * cz, x * cy - y * cx
        rx, ry, rz = px + 2.0 * (w * cx + dx), py + 2.0 * (w * cy + dy), pz + 2.0 * (w * cz + dz)
        points.append((body.position[0] + rx, body.position[1] + ry, body.position[2] + rz))
    return points


def _text(text: str) -> bytes:
    return text.encode() + b"\0"
