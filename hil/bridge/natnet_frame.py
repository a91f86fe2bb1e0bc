"""A NatNet frame of data: bytes to the rigid bodies in it, and the times at which it was seen and sent."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError
from hil.bridge.natnet_packets import Version

_TRACKED = 1
_MODELS_CHANGED = 2

_NUMBER = struct.Struct("<i")
_BODY = struct.Struct("<i7ffh")
_TIMES = struct.Struct("<IIdQQQ")
_PARAMETERS = struct.Struct("<h")
_POINT = 12
_LABELLED = 26
_PRECISION_TIME = 8


class Body(NamedTuple):
    """A rigid body in a frame, by the axes of the motion capture.

    ``id``: its streaming id. ``position`` [m]; ``orientation``: quaternion x, y, z, w. ``error``: mean error
    of its markers [m]. ``tracked``: whether it was seen in this frame; if not, its pose is an old one.
    """

    id: int
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    error: float
    tracked: bool


class Frame(NamedTuple):
    """A frame. Its times are ticks of the server's clock: middle of the exposure, and sending.

    ``models_changed``: whether bodies were added or renamed, so that the model is to be asked for again.
    """

    number: int
    bodies: tuple[Body, ...]
    exposed: int
    sent: int
    models_changed: bool


def read_frame(reader: DatagramReader, version: Version) -> Frame:
    """The frame behind a datagram's head, of a stream of version 3.0 or later.

    Raises :class:`MalformedDatagramError` for what is none.
    """
    (number,) = reader.take(_NUMBER)
    _skip_section(reader, version, _skip_marker_set, 5)
    _skip_points(reader, version, _POINT)
    bodies = _bodies(reader, version)
    _skip_section(reader, version, _skip_skeleton, 8)
    if version.sized:
        # Assets, which no older stream has.
        _skip_points(reader, version, 0)
    _skip_points(reader, version, _LABELLED)
    _skip_section(reader, version, _skip_channels, 8)
    _skip_section(reader, version, _skip_channels, 8)
    _, _, _, exposed, _, sent = reader.take(_TIMES)
    if version.sized and reader.left >= _PRECISION_TIME + _PARAMETERS.size:
        # Where the server has a time of its own to give, which it may leave out.
        reader.skip(_PRECISION_TIME)
    (parameters,) = reader.take(_PARAMETERS)
    return Frame(number, bodies, exposed, sent, bool(parameters & _MODELS_CHANGED))


def _bodies(reader: DatagramReader, version: Version) -> tuple[Body, ...]:
    count, stride = reader.count(_BODY.size), _BODY.size
    if version.sized:
        size = reader.size()
        if count and size % count == 0 and size // count > stride:
            stride = size // count
        if count * stride > size:
            raise MalformedDatagramError("size", f"{count} bodies in {size} bytes")
    bodies = []
    for _ in range(count):
        place = reader.at
        body, x, y, z, qx, qy, qz, qw, error, parameters = reader.take(_BODY)
        bodies.append(Body(body, (x, y, z), (qx, qy, qz, qw), error, bool(parameters & _TRACKED)))
        reader.skip(stride - (reader.at - place))
    return tuple(bodies)


def _skip_section(
    reader: DatagramReader, version: Version, skip: Callable[[DatagramReader], None], least: int
) -> None:
    """Pass over items of ``least`` bytes or more: by the section's size where it has one, else one by one."""
    if version.sized:
        reader.take(_NUMBER)
        reader.skip(reader.size())
        return
    for _ in range(reader.count(least)):
        skip(reader)


def _skip_points(reader: DatagramReader, version: Version, size: int) -> None:
    _skip_section(reader, version, lambda left: left.skip(size), size)


def _skip_marker_set(reader: DatagramReader) -> None:
    reader.text()
    reader.skip(_POINT * reader.count(_POINT))


def _skip_skeleton(reader: DatagramReader) -> None:
    reader.take(_NUMBER)
    reader.skip(_BODY.size * reader.count(_BODY.size))


def _skip_channels(reader: DatagramReader) -> None:
    """A force plate or a device: the samples of each of its channels."""
    reader.take(_NUMBER)
    for _ in range(reader.count(_NUMBER.size)):
        reader.skip(_NUMBER.size * reader.count(_NUMBER.size))
