"""Messages to bytes and back: ROS 2 CDR with its 4-byte header, by ``rosbags``.

The types beyond the standard ROS 2 ones are read from the ``.msg`` files next to this module, so that a lab
can build ROS packages from the very same files.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar, cast

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hil.errors import AbreastError, UsageError
from hil.wire.message_types import OWN_TYPES, Header, Message, Time

M = TypeVar("M", bound=Message)

_NS_PER_S = 1_000_000_000
_LAST_SECOND = 2**31 - 1
_SEPARATOR = "=" * 80
_BIG_ENDIAN = b"\x00\x00"


class MalformedPayloadError(AbreastError):
    """A payload that is not a valid message of the type it was taken for."""


def prepare(typenames: Iterable[str]) -> None:
    """Generate the code for messages of these types now, so that the first of each need not wait for it."""
    for typename in typenames:
        _typestore().get_msgdef(typename)


def encode(message: Message) -> bytes:
    """Return the message as little-endian CDR."""
    return bytes(_typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(payload: bytes | memoryview, typename: str, typestore: Typestore | None = None) -> Message:
    """Return the message of the given type, by the built-in types or by those of :func:`typestore_of`.

    Raises :class:`MalformedPayloadError` for a payload that is not exactly one such message (padding to the
    next multiple of four may follow), and :class:`UsageError` for a type that isn't known. Values are not
    judged: a NaN is a valid float.
    """
    store = typestore or _typestore()
    if typename not in store.fielddefs:
        raise UsageError(f"message type {typename!r} is not known; add its definition or leave it out")
    try:
        return cast("Message", store.deserialize_cdr(payload, typename))
    except SerdeError as error:
        raise MalformedPayloadError(f"not a {typename}: {error}") from None


def in_little_endian(payload: bytes, typename: str) -> bytes:
    """Return the same message as little-endian CDR, all that kernels read.

    A payload that is so already comes back as it is, and so does one that is not a valid message at all.
    """
    if payload[:2] != _BIG_ENDIAN:
        return payload
    try:
        return encode(decode(payload, typename))
    except MalformedPayloadError:
        return payload


def decode_as(payload: bytes | memoryview, kind: type[M]) -> M:
    """Return the message as an instance of ``kind``, a class of :mod:`hil.wire.message_types`; see decode."""
    message = decode(payload, kind.__msgtype__)
    if not isinstance(message, kind):
        raise TypeError(f"{kind.__msgtype__} is represented by {type(message)}, not by {kind}")
    return message


def typename_of(message: Message | type[Message]) -> str:
    """Return the full type name, such as ``abreast_msgs/msg/Command``."""
    return message.__msgtype__


@functools.lru_cache
def typestore_of(typename: str, text: str) -> Typestore:
    """Return the types to decode a foreign type with, given its complete ``ros2msg`` text.

    These are the built-in ones if the layout is the same, so that a message has the classes of
    :mod:`hil.wire.message_types` whoever wrote it. Raises :class:`UsageError` if the text can't be used.
    """
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(text, typename))
        digest = store.hash_rihs01(typename)
    except (TypesysError, KeyError) as error:
        reason = str(error).splitlines()[0]
        raise UsageError(f"message type {typename!r}: its definition can't be used ({reason})") from None
    return _typestore() if typename in _typestore().fielddefs and rihs01(typename) == digest else store


def known_types() -> Typestore:
    """All types that are known without a definition: those of ROS 2, ours, and those of motion capture."""
    return _typestore()


@functools.cache
def definition(typename: str) -> str:
    """Return the type's complete ``ros2msg`` text: its own definition, then those of all it depends on."""
    store = _typestore()
    if typename not in store.fielddefs:
        raise UsageError(f"message type {typename!r} is not known; it has no definition")
    needed: dict[str, tuple[str, str]] = {}
    own_text, _ = store.gendefhash(typename, needed, ros_version=2)
    parts = [_own_texts().get(typename, own_text)]
    for name, (text, _) in needed.items():
        parts.append(f"{_SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{_own_texts().get(name, text)}")
    return "".join(parts)


@functools.cache
def rihs01(typename: str) -> str:
    """Return the type's hash as ROS 2 (Iron and later) puts it on the wire: ``RIHS01_`` and 64 hex digits."""
    return _typestore().hash_rihs01(typename)


def to_time(ns: int) -> Time:
    """Return the stamp of a moment in nanoseconds; exact.

    Raises ValueError if it is negative or too late for a ROS 2 stamp (after January 2038).
    """
    sec, nanosec = divmod(ns, _NS_PER_S)
    if not 0 <= sec <= _LAST_SECOND:
        raise ValueError(f"{ns} ns does not fit a ROS 2 stamp; expected 0 to {_LAST_SECOND} s")
    return Time(sec=sec, nanosec=nanosec)


def to_ns(time: Time) -> int:
    """Return a stamp in nanoseconds; exact.

    Raises :class:`MalformedPayloadError` for a stamp that no clock gives: a negative second or a nanosecond
    part of a second or more.
    """
    if time.sec < 0 or not 0 <= time.nanosec < _NS_PER_S:
        raise MalformedPayloadError(f"stamp {time.sec} s {time.nanosec} ns is not a time after 1970")
    return time.sec * _NS_PER_S + time.nanosec


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header with the given stamp and frame."""
    return Header(stamp=to_time(stamp_ns), frame_id=frame_id)


@functools.cache
def _own_texts() -> dict[str, str]:
    folder = Path(__file__).resolve().parent / "msg"
    return {
        f"{path.parent.name}/msg/{path.stem}": path.read_text(encoding="utf-8")
        for path in sorted(folder.glob("*/*.msg"))
    }


@functools.cache
def _typestore() -> Typestore:
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _own_texts().items():
        store.register(get_types_from_msg(text, name))
    for kind in OWN_TYPES:
        store.types[kind.__msgtype__] = kind
    # The generated code asks for the definition of every nested field, some eighty times a frame.
    store.get_msgdef = functools.cache(store.get_msgdef)  # type: ignore[method-assign]
    return store
