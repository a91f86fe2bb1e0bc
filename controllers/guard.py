"""The last gate before a command leaves: what may not be driven becomes a stop with its reason."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from controllers.limits import is_beyond, limited
from formation.kernel import kernel
from formation.pose import Motion

CLOCK_TOLERANCE_NS = 50_000_000
"""How far [ns] in the future a measurement may seem to lie, by a clock that is ahead of the host's.

Message checks and guard share it, so that a frame that is used is one that may move the robot. It bounds an
age at its lower end only: a clock that is ahead makes measurements seem younger, by no more than this and the
latency together, since beyond that their stamps are refused. So no command rests on a measurement that is
older than the largest age plus both, and a prediction falls short by no more. At the speeds of such robots
50 ms are a centimetre; less would refuse robots and cameras whose clocks are kept by NTP over wireless links.
"""

_CLOCK_TOLERANCE = CLOCK_TOLERANCE_NS * 1e-9


class StopReason(Enum):
    """Why the robot is told to stand still, first reason first; the value is the text for the log."""

    STOPPED = "stopped"
    NO_ESTIMATE = "no estimate"
    LOST = "lost"
    NOT_SETTLED = "not settled"
    STALE = "stale"
    NOT_FINITE = "not finite"

    @property
    def code(self) -> int:
        """The reason's number in a :class:`Decision`: its place in the order, from 1."""
        return _CODES[self]


_CODES = {reason: code for code, reason in enumerate(StopReason, 1)}
_REASONS = {code: reason for reason, code in _CODES.items()}
DRIVING = 0
_STOPPED, _NO_ESTIMATE, _LOST, _NOT_SETTLED, _STALE, _NOT_FINITE = _CODES.values()


def reason_of(code: int) -> StopReason | None:
    """Reason of a code, None for driving."""
    return _REASONS.get(code)


class Standing(NamedTuple):
    """What a command would rest on.

    ``age`` [s] is that of the newest measurement under the estimate, ``known`` whether there is one.
    ``settled``: the estimator has converged since it (re)started. ``lost``: it has given the leader up.
    ``stopped``: a stop was ordered.
    """

    age: float
    known: bool
    settled: bool
    lost: bool
    stopped: bool


class Decision(NamedTuple):
    """What leaves and why.

    ``sent`` is always finite and within the limits. ``wanted`` is what the law asked for, NaN if it was not
    asked. ``saturated``: sent differs from wanted because of the limits. ``reason``: :data:`DRIVING`, or the
    code of the reason why sent is zero.
    """

    sent: Motion
    wanted: Motion
    saturated: bool
    reason: int

    @property
    def stop(self) -> StopReason | None:
        """Why sent is zero, None while driving."""
        return reason_of(self.reason)


@kernel
def refusal(wanted: Motion, standing: Standing, max_age: float) -> int:
    """Code of the first reason not to drive, in the order of :class:`StopReason`; else :data:`DRIVING`.

    The age must lie in [-:data:`CLOCK_TOLERANCE_NS`, max_age]; an age that is NaN or further in the future is
    refused like one that is too old.
    """
    if standing.stopped:
        return _STOPPED
    if not standing.known:
        return _NO_ESTIMATE
    if standing.lost:
        return _LOST
    if not standing.settled:
        return _NOT_SETTLED
    # Asked this way round, so that NaN on either side refuses.
    if not -_CLOCK_TOLERANCE <= standing.age <= max_age:
        return _STALE
    if not (math.isfinite(wanted.v) and math.isfinite(wanted.u)):
        return _NOT_FINITE
    return DRIVING


@kernel
def decide(wanted: Motion, standing: Standing, max_age: float, v_max: float, u_max: float) -> Decision:
    """Let the wanted motion through, limited, or stop."""
    reason = refusal(wanted, standing, max_age)
    if reason != DRIVING:
        return Decision(Motion(0.0, 0.0), wanted, False, reason)
    return Decision(limited(wanted, v_max, u_max), wanted, is_beyond(wanted, v_max, u_max), DRIVING)
