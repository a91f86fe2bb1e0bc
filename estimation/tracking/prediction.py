"""Prediction of what was seen to the time at which a command will act."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.arc import Course, along
from formation.kernel import kernel
from formation.line import Line, leader_seen, line_between
from formation.records import Rows, load, size, store
from formation.ring import Ring, place, without_oldest

LARGEST = 1e6
"""Numbers of an estimate that are not below this are none that a sound estimator gives."""

_NS = 1e-9
_LONGEST_ARC_NS = 50_000_000


class SentCommand(NamedTuple):
    """A command of speed v [m/s] and turn rate u [rad/s] that acts on the robot from ``from_ns`` on."""

    from_ns: int
    v: float
    u: float


class Reported(NamedTuple):
    """What a command takes from an estimate, in the numbers of its message.

    rho [m], alpha2 [rad]; the leader's v1 [m/s], alpha1 [rad], u1 [rad/s] and its variance; the follower's
    v2 [m/s], u2 [rad/s]; all at ``capture_ns``. ``measured_ns``: capture of the newest measurement in it.
    ``cov_alpha1_u1``: [rad^2/s].
    """

    capture_ns: int
    measured_ns: int
    rho: float
    alpha2: float
    v1: float
    alpha1: float
    u1: float
    var_u1: float
    v2: float
    u2: float
    cov_alpha1_u1: float


class Sight(NamedTuple):
    """An estimate as the prediction takes it: its line by pairs, and the motions of both robots.

    ``sound``: whether every number that prediction and law rest on is one that a sound estimator gives; if
    not, all of them are zero.
    """

    capture_ns: int
    measured_ns: int
    line: Line
    v1: float
    u1: float
    v2: float
    u2: float
    sound: bool


class Arc(NamedTuple):
    """Part of a way under one command: time [ns] that it takes, in how many arcs of ``step`` [s] each.

    Over an arc the distance of the motion from its goal shrinks to the share ``decay``, and is ``mean`` of
    what it was at the begin, in the mean.
    """

    span_ns: int
    pieces: int
    step: float
    decay: float
    mean: float


@kernel
def is_sound(reported: Reported) -> bool:
    """Whether there is a distance, and no number is NaN, infinite or absurdly large."""
    leader = abs(reported.v1) < LARGEST and abs(reported.alpha1) < LARGEST and abs(reported.u1) < LARGEST
    follower = abs(reported.alpha2) < LARGEST and abs(reported.v2) < LARGEST and abs(reported.u2) < LARGEST
    return 0.0 < reported.rho < LARGEST and leader and follower


@kernel
def sight_of(reported: Reported) -> Sight:
    """Sight that an estimate gives."""
    if not is_sound(reported):
        nowhere = Line(0.0, 0.0, 0.0, 0.0, 0.0)
        return Sight(reported.capture_ns, reported.measured_ns, nowhere, 0.0, 0.0, 0.0, 0.0, False)
    alpha1, alpha2 = reported.alpha1, reported.alpha2
    line = Line(reported.rho, math.cos(alpha1), math.sin(alpha1), math.cos(alpha2), math.sin(alpha2))
    return Sight(
        reported.capture_ns,
        reported.measured_ns,
        line,
        reported.v1,
        reported.u1,
        reported.v2,
        reported.u2,
        True,
    )


@kernel
def predicted(
    sight: Sight, commands: Rows[SentCommand], sent: Ring, until_ns: int, lag: float, further: float
) -> Line:
    """Line of the pair at ``until_ns``, from the sight at its capture time.

    The leader goes on with its estimated v1 and u1, and turns by ``further`` [rad], evenly on its way, beyond
    that (:meth:`estimation.tracking.turn_prediction.TurnPrediction.further`). The follower starts with its
    measured v2, u2 and follows the commands, given in order of time, through actuators of first-order ``lag``
    [s]; before the first of them it keeps its motion, after the last this one goes on. A sight of later, or
    one by which both come to the same point, is given back as it is.
    """
    total = (until_ns - sight.capture_ns) * _NS
    if total <= 0.0:
        return sight.line
    leader = along(leader_seen(sight.line), sight.v1, sight.u1 + further / total, total)
    line = line_between(leader, _follower_at(sight, commands, sent, until_ns, lag))
    return line if line.rho > 0.0 else sight.line


@kernel
def _follower_at(sight: Sight, commands: Rows[SentCommand], sent: Ring, until_ns: int, lag: float) -> Course:
    """Where the follower will be, seen from where it was at the capture."""
    at, v, u = Course(0.0, 0.0, 1.0, 0.0), sight.v2, sight.u2
    goal_v, goal_u = v, u
    at_ns, arc, spare = sight.capture_ns, Arc(0, 0, 0.0, 0.0, 0.0), Arc(0, 0, 0.0, 0.0, 0.0)
    for k in range(sent.length + 1):
        end_ns, next_v, next_u = until_ns, goal_v, goal_u
        if k < sent.length:
            command = load(SentCommand, commands, place(sent, commands, k))
            end_ns, next_v, next_u = min(command.from_ns, until_ns), command.v, command.u
        if end_ns > at_ns:
            # The exponential is most of the work, and commands mostly come evenly, give or take a nanosecond.
            if end_ns - at_ns != arc.span_ns:
                arc, spare = spare, arc
                if end_ns - at_ns != arc.span_ns:
                    arc = _arc_of(end_ns - at_ns, lag)
            for _ in range(arc.pieces):
                off_v, off_u = v - goal_v, u - goal_u
                at = along(at, goal_v + off_v * arc.mean, goal_u + off_u * arc.mean, arc.step)
                v, u = goal_v + off_v * arc.decay, goal_u + off_u * arc.decay
            at_ns = end_ns
        goal_v, goal_u = next_v, next_u
    return at


@kernel
def _arc_of(span_ns: int, lag: float) -> Arc:
    pieces = (span_ns + _LONGEST_ARC_NS - 1) // _LONGEST_ARC_NS
    step = span_ns * _NS / pieces
    if lag <= 0.0:
        return Arc(span_ns, pieces, step, 0.0, 0.0)
    decay = math.exp(-step / lag)
    return Arc(span_ns, pieces, step, decay, (1.0 - decay) * lag / step)


# Commands on their way, in rows that somebody owns


def rows_for(seconds: float) -> int:
    """Rows for the commands of so many seconds at up to 1,000 a second: a power of two from 64 to 65,536."""
    wanted = max(64.0, min(65_536.0, 1_000.0 * seconds))
    return 1 << math.ceil(math.log2(wanted))


@kernel
def with_command(commands: Rows[SentCommand], sent: Ring, command: SentCommand) -> Ring:
    """Ring with one more command, no earlier than all others; if the rows are full the oldest gives way.

    One that acts from the same moment on as the newest takes its place.
    """
    if sent.length > 0:
        newest = place(sent, commands, sent.length - 1)
        if load(SentCommand, commands, newest).from_ns == command.from_ns:
            store(commands, newest, command)
            return sent
    if sent.length == size(commands):
        sent = without_oldest(sent, commands, 1)
    store(commands, place(sent, commands, sent.length), command)
    return Ring(sent.first, sent.length + 1)


@kernel
def still_needed(commands: Rows[SentCommand], sent: Ring, begin_ns: int) -> Ring:
    """Ring without commands that no prediction from ``begin_ns`` on needs; the one that acts then stays."""
    dropped = 0
    while dropped + 1 < sent.length:
        if load(SentCommand, commands, place(sent, commands, dropped + 1)).from_ns > begin_ns:
            break
        dropped += 1
    return without_oldest(sent, commands, dropped)
