"""What goes wrong with a robot's odometry: faults put over what its wheels would have told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from formation.kernel import kernel
from formation.pose import Motion, Pose, advance
from formation.records import Rows, load, rows_of, size, store
from formation.wrapping import wrapped
from hil.scenario.emulated import OdometryFaultSection

_MOST_SLIP = 0.9
_SMALL = 1e-6


class OdometryFaultKind(IntEnum):
    """Kinds of fault; the names in lower case are the words of scenarios."""

    SILENT = 0
    NAN = 1
    ZERO = 2
    REVERSED = 3
    SCALE = 4
    DELAY = 5
    SLIP = 6
    RESET = 7
    COMMANDS = 8


SILENT = OdometryFaultKind.SILENT.value
NAN = OdometryFaultKind.NAN.value
ZERO = OdometryFaultKind.ZERO.value
REVERSED = OdometryFaultKind.REVERSED.value
SCALE = OdometryFaultKind.SCALE.value
DELAY = OdometryFaultKind.DELAY.value
SLIP = OdometryFaultKind.SLIP.value
RESET = OdometryFaultKind.RESET.value
COMMANDS = OdometryFaultKind.COMMANDS.value


class OdometryFault(NamedTuple):
    """A fault from ``at_s`` after the leader set off: :class:`~hil.scenario.emulated.OdometryFaultSection`.

    ``end_s``: when it is over, infinite for one that lasts.
    """

    kind: int
    at_s: float
    end_s: float
    factor: float
    delay: float


class OdometryTwist(NamedTuple):
    """What becomes of a sample under the faults of its moment.

    told: its motion [m/s, rad/s]. wheels: share of the true motion that the wheels turn by, in v and in u,
    which the pose adds up. silent: there is no sample. resets: the pose begins anew at its origin. delay: how
    much later [s] it comes, and is stamped.
    """

    told: Motion
    wheels: Motion
    silent: bool
    resets: bool
    delay: float


class Reckoning(NamedTuple):
    """Dead reckoning of a robot: the pose that its odometry tells, and where it truly was at that sample."""

    told: Pose
    at: Pose


def odometry_fault_rows(sections: Sequence[OdometryFaultSection]) -> Rows[OdometryFault]:
    """A scenario's faults, in their order."""
    rows = rows_of(OdometryFault, len(sections))
    for k, given in enumerate(sections):
        end_s = given.at_s + given.duration_s if given.duration_s > 0.0 else math.inf
        kind = OdometryFaultKind[given.kind.upper()].value
        store(rows, k, OdometryFault(kind, given.at_s, end_s, given.factor, given.delay_s))
    return rows


@kernel(inline=False)
def faulty_twist(
    faults: Rows[OdometryFault], t: float, period: float, moves: Motion, told: Motion, commanded: Motion
) -> OdometryTwist:
    """What becomes of a sample at t [s] that would have told a motion, under all faults in their order.

    ``moves``: how it truly moves, on which slip depends. ``period`` [s]: from sample to sample; a reset
    happens at one of them. ``commanded``: what the robot was told to drive.
    """
    v, u, wheels_v, wheels_u = told.v, told.u, 1.0, 1.0
    silent, resets, delay = False, False, 0.0
    for k in range(size(faults)):
        fault = load(OdometryFault, faults, k)
        if t < fault.at_s or t >= fault.end_s:
            continue
        if fault.kind == SILENT:
            silent = True
        elif fault.kind == NAN:
            v, u = math.nan, math.nan
        elif fault.kind == ZERO:
            # As from robots whose driver leaves the twist empty: the pose is right.
            v, u = 0.0, 0.0
        elif fault.kind == COMMANDS:
            # As from robots whose driver repeats what it was told: the pose is right here, too.
            v, u = commanded.v, commanded.u
        elif fault.kind == DELAY:
            delay = delay + fault.delay
        elif fault.kind == RESET:
            resets = resets or t < fault.at_s + period
        else:
            by = _wheel_share(fault, moves)
            v, u, wheels_v, wheels_u = by * v, by * u, by * wheels_v, by * wheels_u
    return OdometryTwist(Motion(v, u), Motion(wheels_v, wheels_u), silent, resets, delay)


@kernel
def _wheel_share(fault: OdometryFault, moves: Motion) -> float:
    """How much of the true motion the wheels turn by.

    A robot that slips moves by what its wheels tell less a share of it that grows with its turn rate.
    """
    if fault.kind == REVERSED:
        return -1.0
    if fault.kind == SCALE:
        return fault.factor
    return 1.0 / (1.0 - min(_MOST_SLIP, fault.factor * abs(moves.u)))


@kernel
def reckoned(last: Reckoning, now: Pose, wheels: Motion, resets: bool) -> Reckoning:
    """Reckoning at the next sample: the arc from pose to pose, by what the wheels made of it."""
    dx, dy, turned = now.x - last.at.x, now.y - last.at.y, wrapped(now.theta - last.at.theta)
    half = 0.5 * turned
    middle = last.at.theta + half
    way = dx * math.cos(middle) + dy * math.sin(middle)
    if abs(half) > _SMALL:
        way = way * half / math.sin(half)
    told = last.told
    if resets:
        told = Pose(0.0, 0.0, 0.0)
    return Reckoning(advance(told, wheels.v * way, wheels.u * turned, 1.0), now)
