"""Which logged messages make sense: a recorder keeps whatever can be decoded, whoever sent it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from hil.wire.message_types import CertifiedEstimate, Command, LeaderEstimate, Message, Time, Truth
from hil.wire.messages import MalformedPayloadError, to_ns

_LARGEST = 1e12
_ALL_OF: Mapping[type, attrgetter[Any]] = {
    kind: attrgetter(*(field.name for field in fields(kind))) for kind in (CertifiedEstimate, Command, Truth)
}
_NUMBERS = attrgetter(*QUANTITIES, "rho", "alpha2", "v2", "u2")


def is_sound(message: Message) -> bool:
    """Whether every stamp of a message is a time, its status one that exists, and its numbers can be."""
    try:
        for stamp in _stamps(message):
            to_ns(stamp)
        if isinstance(message, LeaderEstimate):
            Status(message.status)
            return _can_be(message)
        if isinstance(message, CertifiedEstimate | Command | Truth):
            values = _ALL_OF[type(message)](message)
            return not any(isinstance(each, float) and abs(each) > _LARGEST for each in values)
    except (MalformedPayloadError, ValueError):
        return False
    return True


def _can_be(estimate: LeaderEstimate) -> bool:
    """Whether an estimate's numbers are such as a sound estimator gives; deviations may be unknown (NaN)."""
    if not all(-_LARGEST < number < _LARGEST for number in _NUMBERS(estimate)):
        return False
    return not (np.abs(estimate.covariance) >= _LARGEST).any()


def can_be_rows(
    numbers: Mapping[str, NDArray[np.float64]], variances: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Of which estimates, as columns by the fields' names with their variances (n, 5), numbers are sound."""
    told = np.column_stack([numbers[name] for name in (*QUANTITIES, "rho", "alpha2", "v2", "u2")])
    return np.asarray(
        np.all(np.abs(told) < _LARGEST, axis=1) & ~np.any(np.abs(variances) >= _LARGEST, axis=1)
    )


def _stamps(message: Message) -> Iterator[Time]:
    if (header := getattr(message, "header", None)) is not None:
        yield header.stamp
    if isinstance(message, LeaderEstimate | Command):
        yield message.measured
        yield message.computed if isinstance(message, LeaderEstimate) else message.capture
        for receipt in message.consumed:
            yield receipt.received
