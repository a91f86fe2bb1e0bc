from __future__ import annotations

import contextlib
import dataclasses
import io
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter

import hil.wire.messages as messages_module
from hil.errors import UsageError
from hil.wire.message_types import (
    OWN_TYPES,
    CertifiedEstimate,
    Command,
    Consumed,
    Header,
    LeaderEstimate,
    Malformed,
    Marker,
    Message,
    Point,
    Pose,
    Quaternion,
    RangeBearing,
    RigidBodies,
    RigidBody,
    Time,
    Truth,
)
from hil.wire.messages import (
    MalformedPayloadError,
    decode,
    decode_as,
    definition,
    encode,
    rihs01,
    to_ns,
    to_time,
    typename_of,
    typestore_of,
)

MSG_FOLDER = Path(messages_module.__file__).parent / "msg"

floats = st.floats(width=64)
# ROS strings are zero-terminated on the wire; a zero inside is legal CDR all the same.
texts = st.text(max_size=20)
times = st.builds(Time, sec=st.integers(0, 2**31 - 1), nanosec=st.integers(0, 10**9 - 1))
headers = st.builds(Header, stamp=times, frame_id=texts)
points = st.builds(Point, x=floats, y=floats, z=floats)
poses = st.builds(
    Pose, position=points, orientation=st.builds(Quaternion, x=floats, y=floats, z=floats, w=floats)
)
markers = st.builds(Marker, st.integers(-128, 127), st.integers(-(2**31), 2**31 - 1), texts, points)
bodies = st.builds(RigidBody, texts, st.lists(markers, max_size=3), poses)
consumed = st.lists(st.builds(Consumed, st.integers(0, 2**64 - 1), times), max_size=4)
matrices = st.lists(floats, min_size=25, max_size=25).map(lambda values: np.array(values))
payloads = st.binary(max_size=9).map(lambda data: np.frombuffer(data, dtype=np.uint8))

rigid_bodies = st.builds(RigidBodies, headers, st.integers(0, 2**32 - 1), st.lists(bodies, max_size=3))
estimates = st.builds(
    LeaderEstimate,
    headers,
    times,
    times,
    *[floats] * 9,
    matrices,
    floats,
    st.integers(0, 255),
    texts,
    *[floats] * 3,
    consumed,
)
commands = st.builds(
    Command, headers, times, times, *[floats] * 4, st.booleans(), texts, st.booleans(), consumed
)
certified = st.builds(CertifiedEstimate, headers, times, *[floats] * 4, st.integers(0, 2**32 - 1), texts)
truths = st.builds(Truth, headers, st.integers(0, 2**32 - 1), *[floats] * 10)
messages: st.SearchStrategy[Message] = st.one_of(
    rigid_bodies,
    estimates,
    commands,
    certified,
    truths,
    st.builds(RangeBearing, headers, floats, floats),
    st.builds(Malformed, headers, texts, payloads),
)


@given(message=messages)
def test_what_is_encoded_is_decoded_unchanged(message: Message, plain: Callable[[object], object]) -> None:
    payload = encode(message)
    back = decode(payload, typename_of(message))
    assert type(back) is type(message)
    # NaN is not equal to itself, its text is.
    assert repr(plain(back)) == repr(plain(message))
    assert encode(back) == payload


@given(message=messages)
def test_bytes_agree_with_an_independent_implementation(
    message: Message, plain: Callable[[object], object]
) -> None:
    name = typename_of(message)
    stream = io.BytesIO()
    writer: Any = RosWriter(stream)
    writer.write_message("topic", writer.register_msgdef(name, definition(name)), plain(message), log_time=1)
    writer.finish()
    stream.seek(0)
    [(_, _, record)] = make_reader(stream).iter_messages()
    assert record.data == encode(message)


def test_standard_types_are_read_by_an_independent_implementation(
    sample_messages: dict[str, Message], plain: Callable[[object], object]
) -> None:
    for number, message in enumerate(sample_messages.values()):
        name = typename_of(message)
        schema = Schema(id=number, name=name, encoding="ros2msg", data=definition(name).encode())
        read = DecoderFactory().decoder_for("cdr", schema)
        assert read is not None
        assert repr(plain(read(encode(message)))) == repr(plain(message))


@given(message=messages)
def test_big_endian_payloads_are_understood(message: Message, plain: Callable[[object], object]) -> None:
    name = typename_of(message)
    typestore = typestore_of(name, definition(name))
    foreign = bytes(typestore.serialize_cdr(message, name, little_endian=False))
    assert encode(decode(foreign, name)) == encode(message)


@given(payload=st.binary(max_size=300), encapsulated=st.booleans(), kind=st.sampled_from(OWN_TYPES))
def test_random_bytes_are_malformed_or_a_message(
    payload: bytes, encapsulated: bool, kind: type[Message]
) -> None:
    with contextlib.suppress(MalformedPayloadError):
        decode(b"\x00\x01\x00\x00" + payload if encapsulated else payload, typename_of(kind))


@given(message=messages, data=st.data())
def test_a_truncated_payload_is_malformed(message: Message, data: st.DataObject) -> None:
    payload = encode(message)
    length = data.draw(st.integers(0, len(payload) - 1))
    with pytest.raises(MalformedPayloadError):
        decode(payload[:length], typename_of(message))


@given(message=messages, data=st.data())
def test_flipped_bits_are_malformed_or_another_message(message: Message, data: st.DataObject) -> None:
    payload = bytearray(encode(message))
    for position in data.draw(st.lists(st.integers(0, 8 * len(payload) - 1), min_size=1, max_size=8)):
        payload[position // 8] ^= 1 << position % 8
    try:
        back = decode(bytes(payload), typename_of(message))
    except MalformedPayloadError:
        return
    encode(back)


@given(message=messages, garbage=st.binary(min_size=4, max_size=40))
def test_bytes_after_the_message_are_malformed(message: Message, garbage: bytes) -> None:
    with pytest.raises(MalformedPayloadError):
        decode(encode(message) + garbage, typename_of(message))


@pytest.mark.parametrize("count", [2**32 - 1, 4_000_000_000, 2**31, 100_000])
def test_a_count_of_elements_that_are_not_there_costs_nothing(count: int) -> None:
    payload = bytearray(encode(RigidBodies(Header(stamp=to_time(0), frame_id=""), 0, [])))
    payload[-4:] = count.to_bytes(4, "little")
    tracemalloc.start()
    with pytest.raises(MalformedPayloadError):
        decode(bytes(payload), RigidBodies.__msgtype__)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes < 1_000_000


def test_three_random_bytes_are_named_as_what_they_are_not() -> None:
    with pytest.raises(MalformedPayloadError, match="not a mocap4r2_msgs/msg/RigidBodies"):
        decode(b"\x17\xa3\x5c", "mocap4r2_msgs/msg/RigidBodies")


def test_an_unknown_type_is_a_usage_error() -> None:
    for ask in (lambda: decode(b"", "foo_msgs/msg/Bar"), lambda: definition("foo_msgs/msg/Bar")):
        with pytest.raises(UsageError, match="foo_msgs/msg/Bar"):
            ask()


def test_decode_as_gives_the_class_asked_for() -> None:
    sight = RangeBearing(Header(stamp=to_time(5), frame_id="base_link"), 0.2, 1.5)
    assert decode_as(encode(sight), RangeBearing) == sight
    with pytest.raises(MalformedPayloadError):
        decode_as(b"", RangeBearing)


@given(ns=st.integers(0, (2**31 - 1) * 10**9 + 999_999_999))
def test_stamps_are_exact(ns: int) -> None:
    stamp = to_time(ns)
    assert to_ns(stamp) == ns
    assert stamp.sec * 10**9 + stamp.nanosec == ns


@pytest.mark.parametrize("ns", [-1, -(10**18), 2**31 * 10**9])
def test_a_time_that_no_stamp_can_hold_is_refused(ns: int) -> None:
    with pytest.raises(ValueError, match=str(ns)):
        to_time(ns)


@pytest.mark.parametrize("stamp", [Time(sec=-1, nanosec=0), Time(sec=0, nanosec=10**9)])
def test_a_stamp_that_no_clock_gives_is_malformed(stamp: Time) -> None:
    with pytest.raises(MalformedPayloadError):
        to_ns(stamp)


@pytest.mark.parametrize("kind", OWN_TYPES, ids=lambda kind: kind.__name__)
def test_classes_have_the_fields_of_the_msg_files(kind: Any) -> None:
    package, _, name = kind.__msgtype__.split("/")
    text = (MSG_FOLDER / package / f"{name}.msg").read_text(encoding="utf-8")
    lines = [line.partition("#")[0].split() for line in text.splitlines()]
    declared = [line[1] for line in lines if len(line) == 2 and "=" not in line[1]]
    assert [field.name for field in dataclasses.fields(kind)] == declared


def test_every_msg_file_has_its_class() -> None:
    files = {path.stem for path in MSG_FOLDER.glob("*/*.msg")}
    assert files == {kind.__name__ for kind in OWN_TYPES}


def test_the_hash_is_that_of_ros() -> None:
    # As `ros2 topic info --verbose` shows it for std_msgs/msg/String.
    assert rihs01("std_msgs/msg/String") == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


def test_a_foreign_layout_under_a_known_name_is_decoded_as_it_is() -> None:
    name = "abreast_msgs/msg/RangeBearing"
    foreign = typestore_of(name, "float32 rho\nfloat32 alpha2\nfloat32 quality\n")
    payload = b"\x00\x01\x00\x00" + np.array([0.5, -1.0, 2.0], dtype="<f4").tobytes()
    message: Any = decode(payload, name, foreign)
    assert (message.rho, message.alpha2, message.quality) == (0.5, -1.0, 2.0)
    assert decode(payload[:-1] + b"\x00", name, foreign).__msgtype__ == name


@pytest.mark.parametrize("text", ["this is no message text", "foo_msgs/Missing field\n"])
def test_a_definition_that_cannot_be_used_is_a_usage_error(text: str) -> None:
    with pytest.raises(UsageError, match="definition"):
        typestore_of("foo_msgs/msg/Bar", text)
