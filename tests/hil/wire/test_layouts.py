"""Fixed layouts against the general codec: the same bytes out, the same numbers and refusals in."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks import layouts
from formation.byte_access import read_float
from formation.kernel import interpreted
from formation.records import load, row_of, rows_of, store
from hil.wire import entries, estimate_layout, templates
from hil.wire import message_types as msg
from hil.wire.cdr import packed_texts
from hil.wire.message_checks import ACCEPTED, ANY_TIME_NS, MALFORMED
from hil.wire.messages import MalformedPayloadError, _typestore, decode_as, encode, in_little_endian, to_ns
from hil.wire.records import (
    Body,
    CommandNumbers,
    EstimateNumbers,
    FrameHead,
    Odometry,
    Placement,
    Receipt,
    Stamp,
    TruthNumbers,
    Wanted,
)

M = TypeVar("M", bound=msg.Message)

floats = st.floats(width=64)
texts = st.text(max_size=20)
moments = st.integers(0, (2**31 - 1) * 10**9 + 999_999_999)
times = st.builds(msg.Time, sec=st.integers(-(2**31), 2**31 - 1), nanosec=st.integers(0, 2**32 - 1))
headers = st.builds(msg.Header, stamp=times, frame_id=texts)
points = st.builds(msg.Point, x=floats, y=floats, z=floats)
poses = st.builds(
    msg.Pose,
    position=points,
    orientation=st.builds(msg.Quaternion, x=floats, y=floats, z=floats, w=floats),
)
vectors = st.builds(msg.Vector3, x=floats, y=floats, z=floats)
twists = st.builds(msg.Twist, linear=vectors, angular=vectors)
covariances = st.lists(floats, min_size=36, max_size=36).map(np.array)
markers = st.builds(msg.Marker, st.integers(-128, 127), st.integers(-(2**31), 2**31 - 1), texts, points)
names = st.one_of(st.sampled_from(["leader", "follower", "läufer", "leade", ""]), texts)
frames = st.builds(
    msg.RigidBodies,
    headers,
    st.integers(0, 2**32 - 1),
    st.lists(st.builds(msg.RigidBody, names, st.lists(markers, max_size=3), poses), max_size=4),
)
odometries = st.builds(
    msg.Odometry,
    header=headers,
    child_frame_id=texts,
    pose=st.builds(msg.PoseWithCovariance, pose=poses, covariance=covariances),
    twist=st.builds(msg.TwistWithCovariance, twist=twists, covariance=covariances),
)
drives = st.builds(msg.TwistStamped, header=headers, twist=twists)
sightings = st.builds(msg.RangeBearing, headers, floats, floats)
estimates = st.builds(
    msg.LeaderEstimate,
    headers,
    times,
    times,
    *[floats] * 9,
    st.lists(floats, min_size=25, max_size=25).map(np.array),
    floats,
    st.integers(0, 5),
    texts,
    *[floats] * 3,
    st.lists(st.builds(msg.Consumed, st.integers(0, 2**64 - 1), times), max_size=3),
)
commands = st.builds(
    msg.Command,
    headers,
    times,
    times,
    *[floats] * 4,
    st.booleans(),
    texts,
    st.booleans(),
    st.lists(st.builds(msg.Consumed, st.integers(0, 2**64 - 1), times), max_size=3),
)
truths = st.builds(msg.Truth, headers, st.integers(0, 2**32 - 1), *[floats] * 10)
placements = st.builds(Placement, *[floats] * 7)
receipts = st.lists(st.builds(Receipt, st.integers(-(2**63), 2**63 - 1), moments), max_size=3)

ODD = (b"\xff" * 4, bytes(4), b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xc3\xa4", b"\x05")
KNOWN = ("leader", "follower", "läufer")


def big_endian(message: msg.Message) -> bytes:
    return bytes(_typestore().serialize_cdr(message, message.__msgtype__, little_endian=False))


@st.composite
def payloads(draw: st.DrawFn, kind: st.SearchStrategy[Any]) -> bytes:
    """Payload of a message: as it was, or with bytes overwritten, cut out, put in, or another byte order."""
    message = draw(kind)
    if draw(st.booleans()):
        return encode(message)
    payload = bytearray(draw(st.sampled_from([encode, big_endian]))(message))
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(payload)))
        odd = st.sampled_from(
            [b"\xff" * 4, bytes(4), b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xc3\xa4", b"\x05"]
        )
        piece = draw(st.one_of(st.binary(max_size=8), odd))
        payload[at : at + draw(st.sampled_from([0, len(piece), 4, 8]))] = piece
    return bytes(payload[: draw(st.integers(0, len(payload)))] if draw(st.booleans()) else payload)


def decoded(payload: bytes, kind: type[M]) -> M | None:
    try:
        return decode_as(payload, kind)
    except MalformedPayloadError:
        return None


def both(entry: Callable[..., Any], *given: Any) -> Any:
    """What an entry gives, and its plain form as well."""
    compiled, plain = entry(*given), interpreted(entry)(*given)
    assert repr(compiled) == repr(plain)
    return compiled


def raw(*values: float) -> bytes:
    """Floats as their bits: NaN is not equal to itself."""
    return struct.pack(f"<{len(values)}d", *values)


def spread(pose: msg.Pose) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


@given(st.one_of(payloads(frames), st.binary(max_size=80)))
@settings(deadline=None, max_examples=300)
def test_frames_are_read_as_the_general_codec_reads_them(payload: bytes) -> None:
    heads, bodies = rows_of(FrameHead, 1), rows_of(Body, len(KNOWN))
    whole = in_little_endian(payload, msg.RigidBodies.__msgtype__)
    wanted = row_of(Wanted(0, 1, ANY_TIME_NS))
    both(entries.take_frame, whole, packed_texts(KNOWN), heads, bodies, wanted)
    message, head = decoded(payload, msg.RigidBodies), load(FrameHead, heads, 0)
    assert head.sound == (message is not None)
    if message is None:
        return
    stamp = message.header.stamp
    assert (head.stamp, head.frame_number) == (Stamp(stamp.sec, stamp.nanosec), message.frame_number)
    assert head.strangers == sum(body.rigid_body_name not in KNOWN for body in message.rigidbodies)
    for k, name in enumerate(KNOWN):
        shown = [body for body in message.rigidbodies if body.rigid_body_name == name]
        found = load(Body, bodies, k)
        assert found.seen == len(shown)
        if shown:
            assert raw(*found.place) == raw(*spread(shown[0].pose))


@given(st.one_of(payloads(odometries), st.binary(max_size=80)))
@settings(deadline=None, max_examples=150)
def test_odometry_is_read_as_the_general_codec_reads_it(payload: bytes) -> None:
    whole = in_little_endian(payload, msg.Odometry.__msgtype__)
    found, message = both(layouts.read_odometry, whole), decoded(payload, msg.Odometry)
    assert found.sound == (message is not None)
    if message is not None:
        twist, stamp = message.twist.twist, message.header.stamp
        assert found.stamp == (stamp.sec, stamp.nanosec)
        assert raw(*found.place, found.v, found.u) == raw(
            *spread(message.pose.pose), twist.linear.x, twist.angular.z
        )


@given(st.one_of(payloads(drives), payloads(twists), st.binary(max_size=80)), st.booleans())
@settings(deadline=None, max_examples=200)
def test_drive_commands_are_read_as_the_general_codec_reads_them(payload: bytes, stamped: bool) -> None:
    kind: type[msg.Message] = msg.TwistStamped if stamped else msg.Twist
    found = both(entries.read_drive, in_little_endian(payload, kind.__msgtype__), stamped)
    message: Any = decoded(payload, kind)
    assert found.sound == (message is not None)
    if message is not None:
        twist = message.twist if stamped else message
        stamp = message.header.stamp if stamped else msg.Time(sec=0, nanosec=0)
        assert found.stamp == (stamp.sec, stamp.nanosec)
        assert raw(found.v, found.u) == raw(twist.linear.x, twist.angular.z)


@given(st.one_of(payloads(sightings), st.binary(max_size=60)))
@settings(deadline=None, max_examples=150)
def test_sightings_are_read_as_the_general_codec_reads_them(payload: bytes) -> None:
    whole = in_little_endian(payload, msg.RangeBearing.__msgtype__)
    found, message = both(entries.take_sighting, whole, ANY_TIME_NS), decoded(payload, msg.RangeBearing)
    assert (found.cause == MALFORMED) == (message is None)
    if message is not None:
        assert raw(found.rho, found.alpha2) == raw(message.rho, message.alpha2)
    if found.cause == ACCEPTED:
        assert message is not None
        assert found.capture_ns == to_ns(message.header.stamp)


def is_clock(time: msg.Time) -> bool:
    return time.sec >= 0 and time.nanosec < 10**9


@given(st.one_of(payloads(estimates), st.binary(max_size=80)))
@settings(deadline=None, max_examples=200)
def test_estimates_are_read_as_the_general_codec_reads_them(payload: bytes) -> None:
    whole = in_little_endian(payload, msg.LeaderEstimate.__msgtype__)
    rows, covariance = rows_of(EstimateNumbers, 1), np.zeros(25)
    is_one = both(layouts.take_estimate, whole, rows, covariance)
    message = decoded(payload, msg.LeaderEstimate)
    if message is None or not (is_clock(message.header.stamp) and is_clock(message.measured)):
        assert not is_one
        return
    assert is_one == (message.status <= 4)
    if not is_one:
        return
    capture_ns, measured_ns = to_ns(message.header.stamp), to_ns(message.measured)
    read = estimate_layout.read_estimate(whole)
    numbers, m = read.numbers, message
    assert (numbers.capture_ns, numbers.measured_ns, numbers.status) == (capture_ns, measured_ns, m.status)
    assert numbers.computed_ns == m.computed.sec * 10**9 + m.computed.nanosec
    rates = (m.rho, m.alpha2, m.rho_dot, m.alpha2_dot, m.v1, m.alpha1, m.u1, m.v2, m.u2)
    assert raw(*numbers[6:]) == raw(*rates, m.nis, m.bound_v1, m.bound_alpha1, m.bound_h)
    found = [read_float(whole, read.covariance_at + 8 * k) for k in range(25)]
    assert raw(*found) == m.covariance.tobytes()
    stamps = [
        struct.unpack_from("<iI", whole, read.receipts_at + 16 * k + 8) for k in range(numbers.consumed)
    ]
    assert stamps == [(each.received.sec, each.received.nanosec) for each in m.consumed]
    assert load(EstimateNumbers, rows, 0)[:6] == numbers[:6]
    assert covariance.tobytes() == m.covariance.tobytes()


@given(st.one_of(payloads(commands), st.binary(max_size=80)), texts)
@settings(deadline=None, max_examples=200)
def test_decisions_are_read_as_the_general_codec_reads_them(payload: bytes, other: str) -> None:
    whole, message = in_little_endian(payload, msg.Command.__msgtype__), decoded(payload, msg.Command)
    stop = "" if message is None else message.stop
    read = both(layouts.read_command, whole, packed_texts([other, stop]))
    if message is None or not all(map(is_clock, (message.header.stamp, message.capture, message.measured))):
        assert not read.sound
        return
    assert read.sound
    n, m = read.numbers, message
    assert n[:3] == tuple(map(to_ns, (m.header.stamp, m.capture, m.measured)))
    assert n.stop == (0 if other == stop else 1)
    assert raw(n.v2, n.u2, n.v2_wanted, n.u2_wanted) == raw(m.v2, m.u2, m.v2_wanted, m.u2_wanted)
    assert (n.saturated, n.fresh) == (bool(m.saturated), bool(m.fresh))
    ends = [struct.unpack_from("<QiI", whole, read.receipts_at + 16 * k) for k in range(n.consumed)]
    assert ends == [(each.digest, each.received.sec, each.received.nanosec) for each in m.consumed]


@given(st.one_of(payloads(truths), st.binary(max_size=120)))
@settings(deadline=None, max_examples=200)
def test_true_states_are_read_as_the_general_codec_reads_them(payload: bytes) -> None:
    message = decoded(payload, msg.Truth)
    read = both(layouts.read_truth, in_little_endian(payload, msg.Truth.__msgtype__))
    assert read.sound == (message is not None)
    if message is None:
        return
    assert read.stamp == (message.header.stamp.sec, message.header.stamp.nanosec)
    assert read.numbers.frame_number == message.frame_number
    states = [getattr(message, name) for name in TruthNumbers._fields[2:]]
    assert raw(*read.numbers[2:]) == raw(*states)


def stamp(ns: int) -> msg.Time:
    return msg.Time(sec=ns // 10**9, nanosec=ns % 10**9)


def pose_of(place: Placement) -> msg.Pose:
    return msg.Pose(
        position=msg.Point(x=place.x, y=place.y, z=place.z),
        orientation=msg.Quaternion(x=place.qx, y=place.qy, z=place.qz, w=place.qw),
    )


def twist_of(v: float, u: float) -> msg.Twist:
    return msg.Twist(linear=msg.Vector3(x=v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=u))


def consumed(given: Sequence[Receipt]) -> list[msg.Consumed]:
    return [msg.Consumed(each.digest % 2**64, stamp(each.received_ns)) for each in given]


def rows_with(given: Sequence[Receipt]) -> Any:
    rows = rows_of(Receipt, max(1, len(given)))
    for k, each in enumerate(given):
        store(rows, k, each)
    return rows


def forms(entry: Callable[..., Any]) -> tuple[Callable[..., Any], ...]:
    return entry, interpreted(entry)


@given(texts, st.dictionaries(texts, placements, max_size=4), moments, st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=80)
def test_frames_are_written_as_the_general_codec_writes_them(
    frame_id: str, shown: dict[str, Placement], capture_ns: int, number: int
) -> None:
    bodies = rows_of(Body, len(shown))
    for k, place in enumerate(shown.values()):
        store(bodies, k, Body(1, place))
    told = [msg.RigidBody(name, [], pose_of(place)) for name, place in shown.items()]
    expected = encode(msg.RigidBodies(msg.Header(stamp(capture_ns), frame_id), number, told))
    for write in forms(layouts.write_frame):
        buffer, places_at = templates.frame_template(frame_id, list(shown))
        write(buffer, places_at, capture_ns, number, bodies)
        assert buffer.tobytes() == expected


@given(texts, texts, moments, placements, floats, floats)
@settings(deadline=None, max_examples=80)
def test_odometry_is_written_as_the_general_codec_writes_it(
    frame_id: str, child: str, stamp_ns: int, place: Placement, v: float, u: float
) -> None:
    none = np.zeros(36)
    expected = encode(
        msg.Odometry(
            header=msg.Header(stamp(stamp_ns), frame_id),
            child_frame_id=child,
            pose=msg.PoseWithCovariance(pose=pose_of(place), covariance=none),
            twist=msg.TwistWithCovariance(twist=twist_of(v, u), covariance=none),
        )
    )
    for write in forms(layouts.write_odometry):
        template = templates.odometry_template(frame_id, child)
        write(template.buffer, template.numbers_at, stamp_ns, Odometry(True, Stamp(0, 0), place, v, u))
        assert template.buffer.tobytes() == expected


@given(texts, moments, floats, floats, st.booleans())
@settings(deadline=None, max_examples=80)
def test_drive_commands_are_written_as_the_general_codec_writes_them(
    frame_id: str, stamp_ns: int, v: float, u: float, stamped: bool
) -> None:
    twist = twist_of(v, u)
    stamped_twist = msg.TwistStamped(header=msg.Header(stamp(stamp_ns), frame_id), twist=twist)
    for write in forms(entries.write_drive):
        template = templates.drive_template(frame_id, stamped=stamped)
        write(template.buffer, template.numbers_at, stamp_ns, v, u)
        assert template.buffer.tobytes() == encode(stamped_twist if stamped else twist)


@given(
    texts,
    st.lists(moments, min_size=3, max_size=3),
    st.lists(floats, min_size=38, max_size=38),
    texts,
    receipts,
)
@example("", [0, 0, 0], [math.nan] * 38, "", [])
@settings(deadline=None, max_examples=80)
def test_estimates_are_written_as_the_general_codec_writes_them(
    frame_id: str, ns: list[int], numbers: list[float], reason: str, given: list[Receipt]
) -> None:
    covariance = np.array(numbers[13:])
    nis, bounds = numbers[9], numbers[10:13]
    rates, rest = numbers[:9], [covariance, nis, 3, reason, *bounds, consumed(given)]
    fields: list[Any] = [*map(stamp, ns[1:]), *rates, *rest]
    message = msg.LeaderEstimate(msg.Header(stamp(ns[0]), frame_id), *fields)
    reasons = packed_texts(["some other reason", reason])
    ours = row_of(EstimateNumbers(ns[0], ns[1], ns[2], 3, 1, len(given), *numbers[:13]))
    longer = row_of(EstimateNumbers(0, 0, 0, 0, 0, len(given), *[0.5] * 13))
    for write in forms(layouts.write_estimate):
        template = templates.estimate_template(frame_id, 3)
        # What an earlier message left in the buffer must not be seen in a later one.
        write(template.buffer, template.numbers_at, reasons, longer, np.ones(25), rows_with(given))
        length = write(template.buffer, template.numbers_at, reasons, ours, covariance, rows_with(given))
        assert template.payload(length) == encode(message)


@given(
    texts,
    st.lists(moments, min_size=3, max_size=3),
    st.lists(floats, min_size=4, max_size=4),
    st.tuples(st.booleans(), st.booleans()),
    texts,
    receipts,
)
@settings(deadline=None, max_examples=80)
def test_decisions_are_written_as_the_general_codec_writes_them(
    frame_id: str,
    ns: list[int],
    numbers: list[float],
    flags: tuple[bool, bool],
    stop: str,
    given: list[Receipt],
) -> None:
    saturated, fresh = flags
    times = [stamp(moment) for moment in ns[1:]]
    fields: list[Any] = [*times, *numbers, saturated, stop, fresh, consumed(given)]
    message = msg.Command(msg.Header(stamp(ns[0]), frame_id), *fields)
    stops = packed_texts(["", "another stop", stop])
    ours = row_of(CommandNumbers._make([*ns, 2, len(given), *numbers, saturated, fresh]))
    longer = row_of(CommandNumbers(0, 0, 0, 1, len(given), 0.5, 0.5, 0.5, 0.5, True, True))
    for write in forms(layouts.write_command):
        template = templates.command_template(frame_id, 3)
        write(template.buffer, template.numbers_at, stops, longer, rows_with(given))
        length = write(template.buffer, template.numbers_at, stops, ours, rows_with(given))
        assert template.payload(length) == encode(message)


@given(texts, moments, st.integers(0, 2**32 - 1), st.lists(floats, min_size=10, max_size=10))
@settings(deadline=None, max_examples=80)
def test_true_states_are_written_as_the_general_codec_writes_them(
    frame_id: str, stamp_ns: int, number: int, states: list[float]
) -> None:
    message = msg.Truth(msg.Header(stamp(stamp_ns), frame_id), number, *states)
    for write in forms(layouts.write_truth):
        template = templates.truth_template(frame_id)
        write(template.buffer, template.numbers_at, row_of(TruthNumbers(stamp_ns, number, *states)))
        assert template.buffer.tobytes() == encode(message)


@given(st.one_of(st.binary(max_size=12), texts.map(str.encode)))
@settings(deadline=None, max_examples=300)
@example(b"\xe0\x9f\xbf")
@example(b"\xed\xa0\x80")
@example(b"\xf0\x8f\xbf\xbf")
@example(b"\xf4\x90\x80\x80")
@example(b"\xc1\xbf")
@example(b"\xf5\x80\x80\x80")
@example(b"\xe2\x82")
def test_names_must_be_utf8(name: bytes) -> None:
    """Of one stranger: the frame is sound if, and only if, Python can read its name."""
    length = len(name) + 1
    payload = struct.pack("<4sIII", b"\0\1\0\0", 0, 0, 1) + bytes(4) + struct.pack("<II", 7, 1)
    payload += struct.pack("<I", length) + name + bytes(1)
    payload += bytes(-(len(payload) - 4) % 4) + bytes(4)
    payload += bytes(-(len(payload) - 4) % 8) + bytes(56)
    heads, bodies = rows_of(FrameHead, 1), rows_of(Body, 1)
    both(entries.take_frame, payload, packed_texts(["x"]), heads, bodies, row_of(Wanted(0, 0, ANY_TIME_NS)))
    try:
        name.decode()
    except UnicodeDecodeError:
        sound = False
    else:
        sound = True
    assert load(FrameHead, heads, 0).sound is sound


@pytest.mark.parametrize("padding", range(6))
def test_at_most_three_bytes_may_follow(padding: int) -> None:
    payload = encode(twist_of(1.0, 2.0)) + bytes(padding)
    assert both(entries.read_drive, payload, False).sound == (padding < 4)
