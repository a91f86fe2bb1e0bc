"""The server without its sockets: who is answered, who gets frames, and in which layout."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.natnet_client import NatNetClient
from hil.bridge.natnet_frame import Body, read_frame
from hil.bridge.natnet_packets import (
    VERSIONS,
    Kind,
    ServerInfo,
    Version,
    connect_request,
    echo_request,
    opened,
    packet,
    read_echo,
    read_server_info,
    text_request,
)
from hil.bridge.natnet_service import FREQUENCY, NatNetService

S = 1_000_000_000
T0 = 1_700_000_000 * S
CLIENT = ("192.0.2.9", 40_000)
BODY = Body(1, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), 0.0, tracked=True)


@dataclass
class Served:
    """A service whose clock was switched on 100 s before T0."""

    version: Version = VERSIONS[-1]
    multicast: bool = False
    service: NatNetService = field(init=False)

    def __post_init__(self) -> None:
        info = ServerInfo("Motive", "3.1.0.0", self.version, FREQUENCY, 1511, self.multicast)
        self.service = NatNetService(info, ["leader"], 120.0, lambda now_ns: now_ns - T0 + 100 * S)

    def frame(self, number: int = 1, now_ns: int = T0) -> dict[tuple[str, int], bytes]:
        return {where: data for data, where in self.service.frame(number, [BODY], 100 * S, now_ns)}


@pytest.mark.parametrize("version", VERSIONS)
def test_our_client_gets_names_and_frames_of_it(version: Version) -> None:
    served, client = Served(version), NatNetClient()
    for _ in range(2):
        for request in client.requests(T0):
            answer = served.service.hear(request, CLIENT, T0)
            if answer is not None:
                client.hear(answer, T0)
    seen = client.hear(served.frame()[CLIENT], T0)
    assert seen is not None
    assert [(body.name, body.position) for body in seen.bodies] == [("leader", (1.0, 2.0, 3.0))]
    assert abs(seen.capture_ns - T0) < 1000
    assert client.refused == served.service.refused == {}


def test_no_frame_comes_before_the_model_to_where_it_is_asked_for() -> None:
    served = Served()
    served.service.hear(connect_request(), CLIENT, T0)
    assert set(served.frame()) == {(CLIENT[0], 1511)}
    served.service.hear(packet(Kind.REQUEST_MODEL), CLIENT, T0)
    assert set(served.frame()) == {(CLIENT[0], 1511), CLIENT}


def test_who_is_silent_for_ten_seconds_or_leaves_gets_no_more() -> None:
    served, other = Served(), (CLIENT[0], 40_001)
    for client in (CLIENT, other):
        served.service.hear(packet(Kind.KEEP_ALIVE), client, T0)
    served.service.hear(packet(Kind.DISCONNECT), other, T0)
    assert CLIENT in served.frame(now_ns=T0 + 10 * S)
    assert other not in served.frame(now_ns=T0)
    assert CLIENT not in served.frame(now_ns=T0 + 10 * S + 1)


def test_in_multicast_the_group_gets_each_frame_once() -> None:
    served = Served(multicast=True)
    served.service.hear(packet(Kind.KEEP_ALIVE), CLIENT, T0)
    assert set(served.frame()) == {("239.255.42.99", 1511)}


def test_a_client_that_asks_for_an_older_layout_gets_it_and_nobody_else() -> None:
    served, other = Served(), ("192.0.2.10", 40_000)
    for client in (CLIENT, other):
        served.service.hear(packet(Kind.KEEP_ALIVE), client, T0)
    assert served.service.hear(text_request("Bitstream,3.1"), CLIENT, T0) == packet(Kind.RESPONSE, bytes(4))
    frames = served.frame()
    for client, version in ((CLIENT, Version(3, 1)), (other, VERSIONS[-1])):
        _, reader = opened(frames[client])
        assert read_frame(reader, version).bodies == (BODY,)
        answer = served.service.hear(connect_request(), client, T0)
        assert answer is not None
        assert read_server_info(opened(answer)[1]).version == version


def test_echoes_are_answered_by_the_served_clock() -> None:
    answer = Served().service.hear(echo_request(42), CLIENT, T0 + S)
    assert answer is not None
    assert read_echo(opened(answer)[1]) == (42, 101 * FREQUENCY)


def test_the_rate_of_frames_can_be_asked_for() -> None:
    service = Served().service
    assert service.hear(text_request("FrameRate"), CLIENT, T0) == packet(Kind.RESPONSE, b"\0\0\xf0B")
    assert service.hear(text_request("Nonsense"), CLIENT, T0) == packet(Kind.RESPONSE, b"\xff\xff\xff\xff")


@given(
    st.lists(
        st.one_of(st.binary(max_size=60), st.builds(packet, st.sampled_from(Kind), st.binary())), max_size=8
    )
)
def test_nothing_that_comes_makes_it_raise(datagrams: list[bytes]) -> None:
    served = Served()
    for k, data in enumerate(datagrams):
        served.service.hear(data, ("192.0.2.1", k), T0)
    served.frame()


def test_strangers_without_end_are_not_all_remembered() -> None:
    served = Served()
    for k in range(1000):
        served.service.hear(packet(Kind.KEEP_ALIVE), (f"10.0.{k // 250}.{k % 250}", k), T0 + k)
    assert len(served.frame(now_ns=T0)) <= 128
