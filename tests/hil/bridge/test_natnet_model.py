"""Models of every version: the names by streaming ids, whatever stands between."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError
from hil.bridge.natnet_model import read_model
from hil.bridge.natnet_packets import VERSIONS, Kind, Version, opened
from hil.bridge.natnet_writer import model_packet
from tests.hil.bridge.natnet_examples import NAMES, cause_of, full_model

VERSION = st.sampled_from(VERSIONS)
CAUSES = ("", "short", "count", "size", "text", "kind", "length")


@given(
    version=VERSION,
    names=st.dictionaries(st.integers(-(2**31), 2**31 - 1), NAMES, max_size=4),
    bare_bones=st.booleans(),
)
def test_names_are_found_between_all_that_a_model_may_hold(
    version: Version, names: dict[int, str], bare_bones: bool
) -> None:
    assert read_model(DatagramReader(full_model(version, names, bare_bones)), version) == names


@given(version=VERSION, names=st.lists(NAMES, max_size=5))
def test_what_our_server_sends_is_read(version: Version, names: list[str]) -> None:
    kind, reader = opened(model_packet(names, version))
    assert kind == Kind.MODEL
    assert read_model(reader, version) == dict(enumerate(names, start=1))


@given(version=VERSION, data=st.data())
def test_a_model_cut_off_anywhere_is_refused(version: Version, data: st.DataObject) -> None:
    whole = full_model(version, {1: "leader", 2: "follower"})
    with pytest.raises(MalformedDatagramError):
        read_model(DatagramReader(whole[: data.draw(st.integers(0, len(whole) - 1))]), version)


@given(data=st.binary(max_size=300), version=VERSION)
def test_any_bytes_are_read_or_refused(data: bytes, version: Version) -> None:
    assert cause_of(lambda: read_model(DatagramReader(data), version)) in CAUSES


@given(version=VERSION, data=st.data())
def test_a_model_with_wrong_bytes_is_read_or_refused(version: Version, data: st.DataObject) -> None:
    damaged = bytearray(full_model(version, {1: "leader"}))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    assert cause_of(lambda: read_model(DatagramReader(bytes(damaged)), version)) in CAUSES


def test_an_unknown_part_is_refused_where_nobody_says_how_long_it_is() -> None:
    with pytest.raises(MalformedDatagramError, match="kind"):
        read_model(DatagramReader(b"\1\0\0\0\7\0\0\0"), Version(3, 1))


def test_a_body_longer_than_it_says_is_refused() -> None:
    whole = bytearray(full_model(VERSIONS[-1], {1: "leader"}))
    place = whole.index(b"leader") - 4
    whole[place] = 3
    with pytest.raises(MalformedDatagramError):
        read_model(DatagramReader(bytes(whole)), VERSIONS[-1])
