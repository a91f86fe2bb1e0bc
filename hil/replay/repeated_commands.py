"""Commands decided once more: the controller steps through what each logged one says that it rests on.

It is fed with the estimates as logged, so that it is judged by itself.
"""

from __future__ import annotations

from formation.byte_access import bytes_at, read_int64
from formation.kernel import kernel
from formation.records import load, size, store
from hil.nodes.controller_desk import MALFORMED, UNKNOWN_SIDE
from hil.nodes.controller_events import NO_REPORT, NOTHING, STOP, TICK, ControlEvent, Happening
from hil.nodes.controller_inputs import controlled, estimate_heard, noted
from hil.nodes.counting import count
from hil.replay.kept_rows import DriveRow, command_row
from hil.replay.pair_desk import (
    BEGINS,
    DIFFERS,
    DONE,
    ODD,
    PATIENCE_NS,
    ROOM,
    WAITS,
    Lengths,
    Pair,
    Repeats,
    Roles,
    Tallies,
    lost,
)
from hil.replay.repeated_estimates import Receipts, one_more, payload_of, same_bytes
from hil.replay.window import NOT_THERE, Extent, Logged, Topic, Window, found, named_in
from hil.wire.blake2b import digest_of
from hil.wire.cdr import HEAD_BYTES, after_text, begin, ends, read_stamp, text_number
from hil.wire.command_layout import read_command
from hil.wire.drive_layout import read_drive
from hil.wire.estimate_layout import RECEIPT_BYTES
from hil.wire.records import ReadCommand, is_time, ns_of

_LEADER, _ORDER = Happening.LEADER.value, Happening.ORDER.value
_RIGHT = 0


@kernel
def _source(window: Window, roles: Roles, digest: int) -> int:
    """Number of the message that a receipt of the controller names, NOT_THERE for none."""
    place = found(window, digest)
    if place == NOT_THERE:
        return NOT_THERE
    topic = load(Logged, window.logged, place).topic
    if topic == roles.estimate or topic == roles.stop:
        return place
    return place if topic == roles.leader_drive or topic == roles.side else NOT_THERE


@kernel
def _receipts(window: Window, roles: Roles, payload: bytes, read: ReadCommand) -> Receipts:
    missing, sound, at = 0, True, read.receipts_at
    for _ in range(read.numbers.consumed):
        if _source(window, roles, read_int64(payload, at)) == NOT_THERE:
            missing += 1
        sound = sound and is_time(read_stamp(payload, at + 8))
        at += RECEIPT_BYTES
    return Receipts(missing, sound)


@kernel
def _ordered(pair: Pair, payload: bytes) -> ControlEvent:
    """What an order to change sides says; what cannot be read says nothing, and is counted."""
    end = after_text(payload, begin(payload))
    if not ends(payload, end):
        count(pair.controller.counts, MALFORMED)
        return NOTHING
    number = text_number(bytes_at(pair.sides, 0, load(Lengths, pair.lengths, 0).sides), payload, HEAD_BYTES)
    if number < 0:
        count(pair.controller.counts, UNKNOWN_SIDE)
        return NOTHING
    return ControlEvent(_ORDER, 0, 1.0 if number == _RIGHT else -1.0, NO_REPORT)


@kernel
def _led(pair: Pair, payload: bytes, stamped: bool) -> ControlEvent:
    """What the leader is told to drive; what cannot be read says nothing, and is counted."""
    drive = read_drive(payload, stamped)
    if not drive.sound:
        count(pair.controller.counts, MALFORMED)
        return NOTHING
    return ControlEvent(_LEADER, 0, drive.u, NO_REPORT)


@kernel(inline=False)
def _heard(pair: Pair, window: Window, roles: Roles, place: int, now_ns: int) -> None:
    """Put a message down as what has happened to the controller."""
    desk, logged, payload = pair.controller, load(Logged, window.logged, place), payload_of(window, place)
    if logged.topic == roles.estimate:
        if not estimate_heard(desk, payload, logged.digest, now_ns):
            count(desk.counts, MALFORMED)
        return
    noted(desk, logged.digest, now_ns)
    if logged.topic == roles.stop:
        store(desk.event, 0, STOP)
    elif logged.topic == roles.side:
        store(desk.event, 0, _ordered(pair, payload))
    else:
        store(desk.event, 0, _led(pair, payload, roles.stamped))


@kernel(inline=False)
def _decided(pair: Pair, window: Window, roles: Roles, now_ns: int, place: int) -> int:
    """Decide by what has happened, and keep what comes out; the length of the decision, 0 for none.

    ``place``: of the row to keep it in. The drive command goes with the output that is repeated.
    """
    lengths, repeats = load(Lengths, pair.lengths, 0), load(Repeats, pair.deciding, 0)
    stops = bytes_at(pair.stops, 0, lengths.stops)
    length = controlled(pair.controller, stops, now_ns)
    if length == 0:
        return 0
    decision = bytes_at(pair.controller.decision, 0, length)
    store(pair.commands, place, command_row(read_command(decision, stops).numbers))
    if roles.drive >= 0:
        topic, tallies = load(Topic, window.topics, roles.drive), load(Tallies, pair.tallies, 0)
        drive = bytes_at(pair.controller.drive, 0, lengths.drive)
        end = named_in(window, topic, drive, pair.scratch)
        digest = digest_of(bytes_at(pair.scratch, 0, end), topic.name_bytes + lengths.drive)
        store(pair.sent, tallies.sent, DriveRow(digest, repeats.outputs))
        store(pair.tallies, 0, tallies._replace(sent=tallies.sent + 1))
    return length


@kernel(inline=False)
def _repeated(pair: Pair, window: Window, roles: Roles, place: int, read: ReadCommand) -> bool:
    """Repeat an output from the messages that are there; whether it comes out again, alone."""
    payload, at, told, same = payload_of(window, place), read.receipts_at, 0, False
    kept = load(Repeats, pair.deciding, 0).kept
    for _ in range(read.numbers.consumed):
        digest, now_ns = read_int64(payload, at), ns_of(read_stamp(payload, at + 8))
        source = _source(window, roles, digest)
        at += RECEIPT_BYTES
        if source == NOT_THERE:
            lost(pair, digest)
            continue
        _heard(pair, window, roles, source, now_ns)
        length = _decided(pair, window, roles, now_ns, kept + told)
        if length > 0:
            same = same_bytes(bytes_at(pair.controller.decision, 0, length), payload)
            told += 1
    if told == 0:
        store(pair.controller.event, 0, TICK)
        length = _decided(pair, window, roles, read.numbers.stamp_ns, kept)
        if length > 0:
            same = same_bytes(bytes_at(pair.controller.decision, 0, length), payload)
            told = 1
    store(pair.deciding, 0, load(Repeats, pair.deciding, 0)._replace(kept=kept + told))
    return same and told == 1


@kernel(inline=False)
def repeated_commands(pair: Pair, window: Window, final: bool) -> int:
    """Repeat the commands in the window, one after the other; why it ends, as of the estimates."""
    roles, extent = load(Roles, pair.roles, 0), load(Extent, window.extent, 0)
    if not roles.decides or extent.admitted == 0:
        return DONE
    stops = bytes_at(pair.stops, 0, load(Lengths, pair.lengths, 0).stops)
    newest_ns = load(Logged, window.logged, extent.admitted - 1).log_ns
    while True:
        repeats = load(Repeats, pair.deciding, 0)
        place = repeats.next
        if place >= extent.admitted:
            return DONE
        logged = load(Logged, window.logged, place)
        if logged.topic != roles.command:
            store(pair.deciding, 0, repeats._replace(next=place + 1))
            continue
        payload = payload_of(window, place)
        read = read_command(payload, stops)
        if not read.sound:
            return ODD
        issued_ns, consumed = read.numbers.stamp_ns, read.numbers.consumed
        receipts = _receipts(window, roles, payload, read)
        if not receipts.sound:
            return ODD
        if receipts.missing > 0 and not final and newest_ns < logged.log_ns + PATIENCE_NS:
            return WAITS
        if not repeats.begun:
            first_ns = ns_of(read_stamp(payload, read.receipts_at + 8)) if consumed > 0 else issued_ns
            store(pair.deciding, 0, repeats._replace(begin_ns=first_ns))
            return BEGINS
        sent = load(Tallies, pair.tallies, 0).sent
        if repeats.kept + consumed + 1 > size(pair.commands) or sent + consumed + 1 > size(pair.sent):
            return ROOM
        agrees = _repeated(pair, window, roles, place, read)
        after = one_more(repeats, pair.deciding, logged.log_ns, issued_ns, receipts.missing)
        store(pair.deciding, 0, after._replace(sent_before=sent))
        if roles.compares and not agrees:
            return DIFFERS
