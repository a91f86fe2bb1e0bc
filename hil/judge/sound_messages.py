"""Which logged messages make sense: a recorder keeps whatever can be decoded, whoever sent it."""

from __future__ import annotations

from collections.abc import Iterator

from estimation.tracking import Status
from hil.wire.message_types import Command, LeaderEstimate, Message, Time
from hil.wire.messages import MalformedPayloadError, to_ns


def is_sound(message: Message) -> bool:
    """Whether every stamp of a message is a time, and its status one that exists."""
    try:
        for stamp in _stamps(message):
            to_ns(stamp)
        if isinstance(message, LeaderEstimate):
            Status(message.status)
    except (MalformedPayloadError, ValueError):
        return False
    return True


def _stamps(message: Message) -> Iterator[Time]:
    if (header := getattr(message, "header", None)) is not None:
        yield header.stamp
    if isinstance(message, LeaderEstimate | Command):
        yield message.measured
        yield message.computed if isinstance(message, LeaderEstimate) else message.capture
        for receipt in message.consumed:
            yield receipt.received
