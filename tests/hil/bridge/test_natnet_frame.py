"""Frames of every version: what is written is read, whatever stands between, and nothing else is taken."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError
from hil.bridge.natnet_frame import Body, Frame, read_frame
from hil.bridge.natnet_packets import OLDEST, VERSIONS, Kind, Version, opened
from hil.bridge.natnet_writer import frame_packet
from tests.hil.bridge.natnet_examples import BODIES, body_bytes, cause_of, full_frame, section

VERSION = st.sampled_from(VERSIONS)
CAUSES = ("", "short", "count", "size", "text")
ONE = Body(2, (0.25, -0.5, 1.0), (0.0, 0.0, 0.6000000238418579, 0.800000011920929), 0.5, tracked=True)


@given(version=VERSION, bodies=BODIES, changed=st.booleans())
def test_bodies_and_times_are_found_between_all_that_a_frame_may_hold(
    version: Version, bodies: list[Body], changed: bool
) -> None:
    data = full_frame(version, bodies, 2 if changed else 1)
    frame = read_frame(DatagramReader(data), version)
    assert frame == Frame(123, tuple(bodies), exposed=11, sent=13, models_changed=changed)


def test_a_server_may_leave_out_its_precise_time() -> None:
    version = VERSIONS[-1]
    frame = read_frame(DatagramReader(full_frame(version, [ONE], 2, precision=False)), version)
    assert frame == Frame(123, (ONE,), 11, 13, models_changed=True)


@given(version=VERSION, bodies=BODIES)
def test_what_our_server_sends_is_read(version: Version, bodies: list[Body]) -> None:
    names = [f"body{k}" for k in range(len(bodies))]
    bodies = [body._replace(id=k) for k, body in enumerate(bodies)]
    kind, reader = opened(frame_packet(77, names, bodies, (100, 200, 300), 0.5, version))
    assert kind == Kind.FRAME
    assert read_frame(reader, version) == Frame(77, tuple(bodies), 100, 300, models_changed=False)
    assert reader.left == 4


@given(version=VERSION, data=st.data())
def test_a_frame_cut_off_anywhere_is_refused(version: Version, data: st.DataObject) -> None:
    whole = full_frame(version, [ONE, ONE._replace(id=3)], 0)
    # The mark at its end tells nothing; a server may leave out its precise time before it.
    spare = 4 + (8 if version.sized else 0)
    cut = data.draw(st.integers(0, len(whole) - spare - 1))
    with pytest.raises(MalformedDatagramError):
        read_frame(DatagramReader(whole[:cut]), version)


@given(data=st.binary(max_size=400), version=VERSION)
def test_any_bytes_are_read_or_refused(data: bytes, version: Version) -> None:
    assert cause_of(lambda: read_frame(DatagramReader(data), version)) in CAUSES


@given(version=VERSION, data=st.data())
def test_a_frame_with_wrong_bytes_is_read_or_refused(version: Version, data: st.DataObject) -> None:
    damaged = bytearray(full_frame(version, [ONE], 0))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    assert cause_of(lambda: read_frame(DatagramReader(bytes(damaged)), version)) in CAUSES


def test_bodies_that_have_grown_are_read_by_their_size() -> None:
    newer, two = Version(4, 2), [ONE, ONE._replace(id=5)]
    known, grown = [body_bytes(body) for body in two], [body_bytes(body) + b"more" for body in two]
    data = full_frame(newer, two, 0)
    data = data.replace(section(newer, *known), section(newer, *grown))
    frame = read_frame(DatagramReader(data), newer)
    assert frame == Frame(123, tuple(two), 11, 13, models_changed=False)


def test_more_bodies_than_their_section_has_bytes_for_are_refused() -> None:
    data = full_frame(VERSIONS[-1], [ONE], 0)
    place = data.index(body_bytes(ONE)) - 4
    with pytest.raises(MalformedDatagramError, match="size"):
        read_frame(
            DatagramReader(data[:place] + (37).to_bytes(4, "little") + data[place + 4 :]), VERSIONS[-1]
        )


def test_the_oldest_version_has_the_time_of_exposure() -> None:
    assert OLDEST == (3, 0)
