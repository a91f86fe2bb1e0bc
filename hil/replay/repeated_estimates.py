"""Estimates made once more: the estimator steps through what each logged one says that it rests on."""

from __future__ import annotations

from typing import NamedTuple

from formation.byte_access import bytes_at, read_byte, read_int64
from formation.kernel import kernel
from formation.records import Rows, load, size, store
from hil.nodes.estimator_inputs import (
    FRAME,
    ODOMETRY,
    SEEN,
    SIGHTING,
    frame_seen,
    odometry_seen,
    sighting_seen,
    taken,
    ticked,
)
from hil.replay.kept_rows import estimate_row
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
    lost,
)
from hil.replay.window import NOT_THERE, Extent, Logged, Number, Window, found
from hil.wire.cdr import STAMP_BYTES, after_header, aligned, begin, read_stamp
from hil.wire.estimate_layout import RECEIPT_BYTES, read_estimate
from hil.wire.records import ReadEstimate, is_time, ns_of


class Receipts(NamedTuple):
    """How many receipts name an input that is not there; ``sound``: whether all tell a time."""

    missing: int
    sound: bool


@kernel
def payload_of(window: Window, place: int) -> bytes:
    """Payload of a message in the window."""
    logged = load(Logged, window.logged, place)
    return bytes_at(window.arena, logged.at, logged.length)


@kernel
def same_bytes(one: bytes, other: bytes) -> bool:
    """Whether two payloads are the same."""
    length = len(one)
    if length != len(other):
        return False
    words = length // 8
    for k in range(words):
        if read_int64(one, 8 * k) != read_int64(other, 8 * k):
            return False
    same = True
    for k in range(8 * words, length):
        same = same and read_byte(one, k) == read_byte(other, k)
    return same


@kernel
def _source(window: Window, roles: Roles, digest: int) -> int:
    """Number of the message that a receipt of the estimator names, NOT_THERE for none."""
    place = found(window, digest)
    if place == NOT_THERE:
        return NOT_THERE
    topic = load(Logged, window.logged, place).topic
    heard = topic == roles.frame or topic == roles.odometry or topic == roles.sighting
    return place if heard else NOT_THERE


@kernel
def _receipts(window: Window, roles: Roles, payload: bytes, read: ReadEstimate) -> Receipts:
    missing, sound, at = 0, True, read.receipts_at
    for _ in range(read.numbers.consumed):
        if _source(window, roles, read_int64(payload, at)) == NOT_THERE:
            missing += 1
        sound = sound and is_time(read_stamp(payload, at + 8))
        at += RECEIPT_BYTES
    return Receipts(missing, sound)


@kernel(inline=False)
def _stepped(pair: Pair, window: Window, roles: Roles, place: int, now_ns: int) -> int:
    """Step of the estimator with a message; the length of its estimate, 0 for none."""
    desk, logged, lengths = pair.estimator, load(Logged, window.logged, place), load(Lengths, pair.lengths, 0)
    payload, digest = payload_of(window, place), logged.digest
    if logged.topic == roles.frame:
        store(pair.received, place, Number(now_ns))
        what, names = FRAME, bytes_at(pair.names, 0, lengths.names)
        came = frame_seen(desk, payload, names, False, digest, now_ns)
    elif logged.topic == roles.odometry:
        what, came = ODOMETRY, odometry_seen(desk, payload, digest, now_ns)
    else:
        what, came = SIGHTING, sighting_seen(desk, payload, digest, now_ns)
    if came & SEEN == 0:
        return 0
    return taken(desk, what, bytes_at(pair.reasons, 0, lengths.reasons), now_ns)


@kernel
def _kept(pair: Pair, kept: int, length: int) -> None:
    """Keep the estimate that stands in the node's buffer."""
    payload = bytes_at(pair.estimator.buffer, 0, length)
    read = read_estimate(payload)
    store(pair.estimates, kept, estimate_row(read.numbers, payload, read.covariance_at))


@kernel(inline=False)
def _repeated(pair: Pair, window: Window, roles: Roles, place: int, read: ReadEstimate) -> bool:
    """Repeat an output from the messages that are there; whether it comes out again, alone."""
    payload, at, told, same = payload_of(window, place), read.receipts_at, 0, False
    kept = load(Repeats, pair.estimating, 0).kept
    for _ in range(read.numbers.consumed):
        digest = read_int64(payload, at)
        source = _source(window, roles, digest)
        if source == NOT_THERE:
            lost(pair, digest)
        else:
            length = _stepped(pair, window, roles, source, ns_of(read_stamp(payload, at + 8)))
            if length > 0:
                same = same_bytes(bytes_at(pair.estimator.buffer, 0, length), payload)
                _kept(pair, kept + told, length)
                told += 1
        at += RECEIPT_BYTES
    if told == 0:
        reasons = bytes_at(pair.reasons, 0, load(Lengths, pair.lengths, 0).reasons)
        length = ticked(pair.estimator, reasons, read.numbers.computed_ns)
        if length > 0:
            same = same_bytes(bytes_at(pair.estimator.buffer, 0, length), payload)
            _kept(pair, kept, length)
            told = 1
    done = load(Repeats, pair.estimating, 0)
    store(pair.estimating, 0, done._replace(kept=kept + told))
    return same and told == 1


@kernel(inline=False)
def repeated_estimates(pair: Pair, window: Window, final: bool) -> int:
    """Repeat the estimates in the window, one after the other; why it ends.

    ``final``: no more messages will come. Where one does not come out again, it is the last that was done.
    """
    roles, extent = load(Roles, pair.roles, 0), load(Extent, window.extent, 0)
    if extent.admitted == 0:
        return DONE
    newest_ns = load(Logged, window.logged, extent.admitted - 1).log_ns
    while True:
        repeats = load(Repeats, pair.estimating, 0)
        place = repeats.next
        if place >= extent.admitted:
            return DONE
        logged = load(Logged, window.logged, place)
        if logged.topic != roles.estimate:
            store(pair.estimating, 0, repeats._replace(next=place + 1))
            continue
        payload = payload_of(window, place)
        read = read_estimate(payload)
        if not read.sound:
            return ODD
        computed, count = read.numbers.computed_ns, read.numbers.consumed
        receipts = _receipts(window, roles, payload, read)
        if not receipts.sound or not _is_computed(payload):
            return ODD
        if receipts.missing > 0 and not final and newest_ns < logged.log_ns + PATIENCE_NS:
            return WAITS
        if not repeats.begun:
            first_ns = ns_of(read_stamp(payload, read.receipts_at + 8)) if count > 0 else computed
            store(pair.estimating, 0, repeats._replace(begin_ns=first_ns))
            return BEGINS
        if repeats.kept + count + 1 > size(pair.estimates):
            return ROOM
        agrees = _repeated(pair, window, roles, place, read)
        after = one_more(repeats, pair.estimating, logged.log_ns, computed, receipts.missing)
        store(pair.estimating, 0, after)
        if roles.compares and not agrees:
            return DIFFERS


@kernel
def _is_computed(payload: bytes) -> bool:
    """Whether an estimate that can be read tells when it was made."""
    return is_time(read_stamp(payload, aligned(after_header(payload, begin(payload)), 4) + STAMP_BYTES))


@kernel
def one_more(before: Repeats, rows: Rows[Repeats], logged_ns: int, made_ns: int, missing: int) -> Repeats:
    """How far it is with one output more; ``before``: how far it was."""
    repeats = load(Repeats, rows, 0)
    return repeats._replace(
        next=before.next + 1,
        outputs=before.outputs + 1,
        missing=before.missing + missing,
        logged_ns=logged_ns,
        before_ns=before.computed_ns,
        computed_ns=made_ns,
        kept_before=before.kept,
        missing_before=before.missing,
    )
