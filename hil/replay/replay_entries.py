"""A replay, compiled: what Python enters once for some seconds of a log."""

from __future__ import annotations

from typing import NamedTuple

from estimation.time.delay_line import Arrival
from formation.byte_access import bytes_at
from formation.kernel import entry, kernel
from formation.records import Rows, load, size, store
from hil.replay.noted_messages import noted_messages
from hil.replay.pair_desk import BEGINS, DIFFERS, DONE, ODD, ROOM, Lengths, Pair, Repeats, Roles, Tallies
from hil.replay.repeated_commands import repeated_commands
from hil.replay.repeated_estimates import payload_of, repeated_estimates
from hil.replay.window import Extent, Logged, Number, Window, admitted, found, moved_up, taken_in
from hil.wire.frame_layout import read_bodies
from hil.wire.records import is_time, ns_of

FULL, BROKEN = 6, 7
"""Why a replay stops, beside what :mod:`hil.replay.pair_desk` has: the window is full; a chunk is broken."""

LISTENING, ESTIMATING, DECIDING = range(3)
"""What it was at."""


NOTHING = -1


class Stage(NamedTuple):
    """How far a replay is.

    ``at``: of the chunk's bytes those before it are in the window. ``until_ns``: before when all messages are
    there. ``first``: the first one in the window that is still needed, NOTHING to leave it as it is.
    ``final``: no more will come. ``why``, ``what``, ``pair``: why it stops, at what, of which pair; or what
    is wrong with the chunk.
    """

    at: int
    until_ns: int
    first: int
    final: bool
    why: int
    what: int
    pair: int


@kernel(inline=False)
def _left(pair: Pair, window: Window, first: int) -> int:
    """Keep the arrivals of frames that leave the window; ROOM where there is none for them."""
    extent, tallies = load(Extent, window.extent, 0), load(Tallies, pair.tallies, 0)
    frame, arrivals = load(Roles, pair.roles, 0).frame, tallies.arrivals
    if arrivals + first > size(pair.arrivals):
        return ROOM
    names = bytes_at(pair.names, 0, load(Lengths, pair.lengths, 0).names)
    for place in range(first):
        logged = load(Logged, window.logged, place)
        if logged.topic != frame:
            continue
        received_ns = load(Number, pair.received, found(window, logged.digest)).value
        head = read_bodies(payload_of(window, place), names, pair.estimator.bodies)
        if received_ns > 0 and head.sound and is_time(head.stamp):
            store(pair.arrivals, arrivals, Arrival(head.frame_number, ns_of(head.stamp), received_ns))
            arrivals += 1
    for place in range(first, extent.messages):
        store(pair.received, place - first, load(Number, pair.received, place))
    for place in range(max(0, extent.messages - first), extent.messages):
        store(pair.received, place, Number(0))
    estimating, deciding = load(Repeats, pair.estimating, 0), load(Repeats, pair.deciding, 0)
    store(pair.estimating, 0, estimating._replace(next=max(0, estimating.next - first)))
    store(pair.deciding, 0, deciding._replace(next=max(0, deciding.next - first)))
    store(pair.tallies, 0, tallies._replace(arrivals=arrivals, next=max(0, tallies.next - first)))
    return DONE


@kernel
def _forgotten(window: Window, pairs: Rows[Pair], stage: Stage) -> Stage:
    """Let what is no longer needed leave the window."""
    for k in range(stage.pair, size(pairs)):
        if _left(load(Pair, pairs, k), window, stage.first) == ROOM:
            return stage._replace(why=ROOM, what=LISTENING, pair=k)
    moved_up(window, stage.first)
    return stage._replace(first=NOTHING, pair=0, why=DONE)


@kernel
def _ends(why: int) -> bool:
    """Whether Python has to look at why steps ended."""
    return why in (BEGINS, DIFFERS, ROOM, ODD)


@kernel
def _of_all(window: Window, pairs: Rows[Pair], stage: Stage) -> Stage:
    """Note and repeat what is in the window for every pair."""
    for k in range(size(pairs)):
        pair = load(Pair, pairs, k)
        why = noted_messages(pair, window)
        if why != DONE:
            return stage._replace(why=why, what=LISTENING, pair=k)
        why = repeated_estimates(pair, window, stage.final)
        if _ends(why):
            return stage._replace(why=why, what=ESTIMATING, pair=k)
        why = repeated_commands(pair, window, stage.final)
        if _ends(why):
            return stage._replace(why=why, what=DECIDING, pair=k)
    return stage._replace(why=DONE)


@entry
def go_on(windows: Rows[Window], pairs: Rows[Pair], stages: Rows[Stage], chunk: bytes) -> None:
    """Go on with a replay by the records of a chunk, and say in the stage why it stops.

    Whoever calls sees to that and calls again, until all is done.
    """
    window, stage = load(Window, windows, 0), load(Stage, stages, 0)
    if stage.first != NOTHING:
        stage = _forgotten(window, pairs, stage)
        if stage.first != NOTHING:
            store(stages, 0, stage)
            return
    at = taken_in(window, chunk, stage.at)
    if at < len(chunk):
        why = BROKEN if at < 0 else FULL
        store(stages, 0, stage._replace(at=max(at, stage.at), why=why, what=at, pair=0))
        return
    admitted(window, stage.until_ns)
    if load(Extent, window.extent, 0).odd:
        store(stages, 0, stage._replace(at=at, why=ODD, pair=0))
        return
    store(stages, 0, _of_all(window, pairs, stage._replace(at=at)))
