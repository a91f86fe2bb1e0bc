from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hil.errors import UsageError
from hil.log.cdr_columns import MOST_NUMBERED, columns_of, fields_of
from hil.wire.message_types import Message, Time
from hil.wire.messages import MalformedPayloadError, decode, encode, known_types, typename_of
from tests.hil.wire.test_messages import messages


def flat(value: Any, name: str = "") -> dict[str, Any]:
    """Fields of a message as the columns are to have them: the long way round, message by message."""
    if hasattr(value, "sec") and hasattr(value, "nanosec"):
        return {name: value.sec * 1_000_000_000 + value.nanosec}
    if dataclasses.is_dataclass(value):
        found: dict[str, Any] = {}
        for field in dataclasses.fields(value):
            if field.name[0] != "_" and not field.name.isupper():
                found |= flat(getattr(value, field.name), f"{name}.{field.name}".lstrip("."))
        return found
    if isinstance(value, np.ndarray) and name.endswith("covariance"):
        return {f"{name}.{number}": each for number, each in enumerate(value.tolist())}
    if isinstance(value, np.ndarray):
        return {name: value.tolist()}
    if isinstance(value, list):
        each_flat = [flat(each, name) for each in value]
        names = dict.fromkeys(key for each in each_flat for key in each)
        return {key: [each.get(key, []) for each in each_flat] for key in names}
    return {name: value}


def rows_of(typename: str, payloads: list[bytes]) -> tuple[list[dict[str, Any]], list[bool]]:
    names = [field.name for field in fields_of(known_types(), typename)]
    found = columns_of(known_types(), typename, payloads)
    rows = zip(*(values.tolist() for values in found.values), strict=True)
    return [dict(zip(names, row, strict=True)) for row in rows], found.sound.tolist()


def decoded(payload: bytes, typename: str) -> dict[str, Any] | None:
    try:
        return flat(decode(payload, typename))
    except MalformedPayloadError:
        return None


@given(drawn=st.lists(messages, min_size=1, max_size=6))
def test_columns_hold_what_each_message_holds(drawn: list[Message]) -> None:
    alike = [message for message in drawn if type(message) is type(drawn[0])]
    rows, sound = rows_of(typename_of(drawn[0]), [encode(message) for message in alike])
    assert all(sound)
    for row, message in zip(rows, alike, strict=True):
        wanted = flat(message)
        assert {key: repr(row[key]) for key in wanted} == {key: repr(wanted[key]) for key in wanted}
        # What elements would have had of lists that are empty.
        assert all(not any(row[key]) for key in row.keys() - wanted)


@given(message=messages, data=st.data())
def test_what_is_no_message_is_left_out_as_the_general_codec_does(
    message: Message, data: st.DataObject
) -> None:
    typename, payload = typename_of(message), bytearray(encode(message))
    for place in data.draw(st.lists(st.integers(4, len(payload) - 1), max_size=3)):
        payload[place] = data.draw(st.sampled_from([0, 1, 255]))
    cut = bytes(payload[: data.draw(st.integers(4, len(payload)))])
    bent = bytes(payload)
    wanted = [decoded(cut, typename), decoded(bent, typename), flat(message)]
    rows, sound = rows_of(typename, [cut, bent, encode(message)])
    assert sound == [each is not None for each in wanted]
    for row, whole in zip(rows, filter(None, wanted), strict=True):
        assert {key: repr(row[key]) for key in whole} == {key: repr(whole[key]) for key in whole}


def test_payloads_of_both_byte_orders_go_together(sample_messages: dict[str, Message]) -> None:
    message = sample_messages["rigid_bodies"]
    typename = typename_of(message)
    big = bytes(known_types().serialize_cdr(message, typename, little_endian=False))
    rows, sound = rows_of(typename, [big, encode(message), b"", big])
    assert sound == [True, True, False, True]
    assert rows[0] == rows[1] == rows[2]
    assert rows[0]["rigidbodies.rigid_body_name"] == ["leader", "follower"]
    assert rows[0]["rigidbodies.markers.translation.y"] == [[2.0, 2.0], []]


def test_a_long_array_is_a_list_and_a_bounded_one_is_held_to_its_bound() -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(f"uint8[{MOST_NUMBERED + 1}] many\nint16[<=2] few", "a_msgs/msg/A"))
    names = [field.name for field in fields_of(store, "a_msgs/msg/A")]
    assert names == ["many", "few"]
    head, many = b"\x00\x01\x00\x00", bytes(range(MOST_NUMBERED + 1))
    two = b"\0\0\0\x02\0\0\0\xff\xff\x05\0"
    three = b"\0\0\0\x03\0\0\0\xff\xff\x05\0\x05\0"
    found = columns_of(store, "a_msgs/msg/A", [head + many + two, head + many + three])
    assert found.sound.tolist() == [True, False]
    assert [values.tolist() for values in found.values] == [[list(many)], [[-1, 5]]]


def test_there_may_be_no_payload_at_all() -> None:
    found = columns_of(known_types(), Time.__msgtype__, [])
    assert [values.tolist() for values in found.values] == [[]]


def test_an_unknown_type_is_refused() -> None:
    with pytest.raises(UsageError, match="not known"):
        fields_of(known_types(), "no_msgs/msg/None")


def test_a_field_that_nobody_reads_is_refused_beforehand() -> None:
    store = get_typestore(Stores.EMPTY)
    store.register({"a_msgs/msg/A": ([], [("deep", (Nodetype.BASE, ("float128", 0)))])})
    with pytest.raises(UsageError, match="'float128' are not supported"):
        fields_of(store, "a_msgs/msg/A")
