"""NatNet's model definition: bytes to the names of rigid bodies by their streaming ids."""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import IntEnum

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError
from hil.bridge.natnet_packets import Version

Names = dict[int, str]
"""Names of rigid bodies by their streaming ids."""

_NUMBER = struct.Struct("<i")
_PLACED = struct.Struct("<ii3f")
_POINT = 12
_CALIBRATION = 4 * (2 + 3 + 12 * 12 + 4 * 3 + 2)
_CAMERA = 4 * (3 + 4)
_DEVICE = 4 * 2


class _Part(IntEnum):
    MARKER_SET = 0
    BODY = 1
    SKELETON = 2
    FORCE_PLATE = 3
    DEVICE = 4
    CAMERA = 5


def read_model(reader: DatagramReader, version: Version) -> Names:
    """The names in a model definition behind a datagram's head, of a stream of version 3.0 or later.

    Raises :class:`MalformedDatagramError` for what is none.
    """
    if version.sized:
        return _sized_parts(reader)
    # Bones of skeletons have their markers listed by some servers before 4.1, by others not. Nothing but the
    # length of the whole tells which.
    start = reader.at
    try:
        return _parts(reader, version, bare_bones=False)
    except MalformedDatagramError:
        reader.at = start
        return _parts(reader, version, bare_bones=True)


def _sized_parts(reader: DatagramReader) -> Names:
    names: Names = {}
    for _ in range(reader.count(8)):
        (kind,) = reader.take(_NUMBER)
        end = reader.size() + reader.at
        if kind == _Part.BODY:
            name = reader.text()
            names[reader.take(_NUMBER)[0]] = name
        if reader.at > end:
            raise MalformedDatagramError("size", f"body {name!r} is longer than it says")
        reader.skip(end - reader.at)
    return names


def _parts(reader: DatagramReader, version: Version, *, bare_bones: bool) -> Names:
    names: Names = {}
    for _ in range(reader.count(4)):
        (kind,) = reader.take(_NUMBER)
        if kind == _Part.BODY:
            body, name = _body(reader, version)
            names[body] = name
        elif kind == _Part.SKELETON:
            reader.text()
            reader.take(_NUMBER)
            for _ in range(reader.count(1)):
                _body(reader, version, bare=bare_bones)
        elif kind in _SKIPPED:
            _SKIPPED[kind](reader)
        else:
            raise MalformedDatagramError("kind", f"{kind} is no part of a model")
    if reader.left:
        raise MalformedDatagramError("length", f"{reader.left} bytes are left behind a model")
    return names


def _body(reader: DatagramReader, version: Version, *, bare: bool = False) -> tuple[int, str]:
    name = reader.text()
    body, *_ = reader.take(_PLACED)
    if not bare:
        markers = reader.count(_POINT + _NUMBER.size)
        reader.skip(markers * (_POINT + _NUMBER.size))
        if version.major >= 4:
            _skip_texts(reader, markers)
    return body, name


def _skip_texts(reader: DatagramReader, number: int) -> None:
    for _ in range(number):
        reader.text()


def _skip_marker_set(reader: DatagramReader) -> None:
    reader.text()
    _skip_texts(reader, reader.count())


def _skip_force_plate(reader: DatagramReader) -> None:
    reader.take(_NUMBER)
    reader.text()
    reader.skip(_CALIBRATION)
    _skip_texts(reader, reader.count())


def _skip_device(reader: DatagramReader) -> None:
    reader.take(_NUMBER)
    reader.text()
    reader.text()
    reader.skip(_DEVICE)
    _skip_texts(reader, reader.count())


def _skip_camera(reader: DatagramReader) -> None:
    reader.text()
    reader.skip(_CAMERA)


_SKIPPED: dict[int, Callable[[DatagramReader], None]] = {
    _Part.MARKER_SET: _skip_marker_set,
    _Part.FORCE_PLATE: _skip_force_plate,
    _Part.DEVICE: _skip_device,
    _Part.CAMERA: _skip_camera,
}
