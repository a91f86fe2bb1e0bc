"""NatNet's small datagrams: there and back, and what of them is refused."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.datagram_reader import MalformedDatagramError
from hil.bridge.natnet_packets import (
    DATA_PORT,
    MULTICAST_GROUP,
    VERSIONS,
    Echo,
    Kind,
    ServerInfo,
    Version,
    connect_request,
    echo_request,
    echo_response,
    opened,
    packet,
    read_echo,
    read_echo_request,
    read_server_info,
    server_info,
    text_request,
)

TICKS = st.integers(0, 2**64 - 1)


@given(
    st.builds(
        ServerInfo,
        st.text("abc äö", max_size=40),
        st.just("3.1.0.1"),
        st.sampled_from(VERSIONS),
        TICKS,
        st.integers(1, 65_535),
        st.booleans(),
        st.just("239.1.2.3"),
    )
)
def test_a_server_is_read_as_it_describes_itself(info: ServerInfo) -> None:
    kind, reader = opened(server_info(info))
    assert kind == Kind.SERVER_INFO
    assert read_server_info(reader) == info
    assert reader.left == 0


def test_a_server_of_old_says_less() -> None:
    whole = server_info(ServerInfo("Motive", "1.10.0.0", Version(2, 10)))
    _, reader = opened(struct.pack("<HH", Kind.SERVER_INFO, 264) + whole[4:268])
    expected = ServerInfo("Motive", "1.10.0.0", Version(2, 10), 0, DATA_PORT, False, MULTICAST_GROUP)
    assert read_server_info(reader) == expected


@given(number=TICKS, ticks=TICKS)
def test_an_echo_brings_its_number_back(number: int, ticks: int) -> None:
    kind, asked = opened(echo_request(number))
    assert kind == Kind.ECHO_REQUEST
    assert read_echo_request(asked) == number
    kind, answered = opened(echo_response(Echo(number, ticks)))
    assert kind == Kind.ECHO_RESPONSE
    assert read_echo(answered) == Echo(number, ticks)


@pytest.mark.parametrize("change", [-1, 1])
def test_a_datagram_whose_head_has_another_length_is_refused(change: int) -> None:
    data = bytearray(packet(Kind.FRAME, b"abcdef"))
    data[2] += change
    with pytest.raises(MalformedDatagramError) as caught:
        opened(bytes(data))
    assert caught.value.cause == "length"


def test_who_connects_asks_for_the_newest_layout_that_is_read_here() -> None:
    kind, reader = opened(connect_request())
    body = reader.rest()
    assert kind == Kind.CONNECT
    assert body[:5] == b"Ping\0"
    assert body[260:262] == body[265:267] == bytes(VERSIONS[-1])
    assert body[264] == 0


def test_a_request_in_words_ends_with_a_zero() -> None:
    assert text_request("Bitstream,4.1") == b"\x02\x00\x0e\x00Bitstream,4.1\0"
