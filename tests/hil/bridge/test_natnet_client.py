"""The client without its sockets: what it asks and takes, and that nothing from the wire makes it raise."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.natnet_client import NatNetClient
from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import (
    NEWEST,
    VERSIONS,
    Echo,
    Kind,
    ServerInfo,
    Version,
    echo_response,
    opened,
    packet,
    read_echo_request,
    response,
    server_info,
)
from hil.bridge.natnet_writer import frame_packet, model_packet
from tests.hil.bridge.natnet_examples import full_frame, full_model

MS = 1_000_000
S = 1_000_000_000
T0 = 1_700_000_000 * S
FREQUENCY = 1_000_000
INFO = ServerInfo("Motive", "2.2.0.0", Version(3, 1), FREQUENCY)
LEADER = Body(1, (1.0, 2.0, 0.5), (0.0, 0.0, 0.0, 1.0), 0.0, tracked=True)
LOST = Body(2, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 0.0, tracked=False)


def ticks_at(host_ns: int) -> int:
    """The server was switched on 1000 s before T0."""
    return (host_ns - T0 + 1000 * S) * FREQUENCY // S


def frame(number: int, exposed_ns: int, sent_ns: int, info: ServerInfo = INFO) -> bytes:
    ticks = (ticks_at(exposed_ns), ticks_at(exposed_ns), ticks_at(sent_ns))
    return frame_packet(number, ["leader", "follower"], [LEADER, LOST], ticks, 0.0, info.version)


def kinds(requests: list[bytes]) -> list[int]:
    return [opened(request)[0] for request in requests]


def connected(info: ServerInfo = INFO) -> NatNetClient:
    """A client that knows server, model and clock at T0."""
    client = NatNetClient()
    assert kinds(client.requests(T0)) == [Kind.CONNECT]
    client.hear(server_info(info), T0)
    for request in client.requests(T0):
        kind, reader = opened(request)
        if kind == Kind.ECHO_REQUEST:
            client.hear(echo_response(Echo(read_echo_request(reader), ticks_at(T0 + MS))), T0 + 2 * MS)
        elif kind == Kind.REQUEST_MODEL:
            client.hear(model_packet(["leader", "follower"], info.version), T0 + MS)
    return client


@pytest.mark.parametrize("version", VERSIONS)
def test_a_frame_has_the_host_time_of_its_exposure_and_names_by_the_model(version: Version) -> None:
    info = INFO._replace(version=version)
    client = connected(info)
    seen = client.hear(frame(7, T0 + 10 * MS, T0 + 14 * MS, info), T0 + 20 * MS)
    assert seen is not None
    assert (seen.number, seen.arrived_ns) == (7, T0 + 20 * MS)
    assert seen.capture_ns == pytest.approx(T0 + 10 * MS, abs=2000)
    assert [(body.name, body.id, body.tracked) for body in seen.bodies] == [
        ("leader", "1", True),
        ("follower", "2", False),
    ]
    assert client.refused == {}
    assert client.guessed == 0


def test_the_server_is_asked_again_until_it_answers() -> None:
    client = NatNetClient()
    asked = [kinds(client.requests(T0 + k * S // 4)) for k in range(9)]
    assert asked == [[Kind.CONNECT], [], [], [], [Kind.CONNECT], [], [], [], [Kind.CONNECT]]
    assert client.due_ns() == T0 + 3 * S


def test_the_model_is_asked_for_until_it_comes_and_when_a_frame_knows_of_another() -> None:
    client = NatNetClient()
    client.requests(T0)
    client.hear(server_info(INFO), T0)
    assert Kind.REQUEST_MODEL in kinds(client.requests(T0))
    assert Kind.REQUEST_MODEL not in kinds(client.requests(T0 + S // 2))
    assert Kind.REQUEST_MODEL in kinds(client.requests(T0 + S))
    client.hear(model_packet(["leader"], INFO.version), T0 + S)
    assert Kind.REQUEST_MODEL not in kinds(client.requests(T0 + 2 * S))
    seen = client.hear(frame(1, T0 + 2 * S, T0 + 2 * S), T0 + 2 * S)
    assert seen is not None
    assert [body.name for body in seen.bodies] == ["leader", "2"]
    assert Kind.REQUEST_MODEL in kinds(client.requests(T0 + 3 * S))


def test_a_server_that_fell_silent_is_asked_from_the_start() -> None:
    client = connected()
    client.hear(frame(1, T0 + S, T0 + S), T0 + S)
    assert Kind.CONNECT not in kinds(client.requests(T0 + 4 * S))
    assert kinds(client.requests(T0 + 4 * S + 1)) == [Kind.CONNECT]
    assert client.info is None
    assert client.hear(frame(2, T0 + 5 * S, T0 + 5 * S), T0 + 5 * S) is None
    assert client.refused == {"before_server_info": 1}


def test_a_server_keeps_streaming_as_it_is_told_that_somebody_listens() -> None:
    client = connected()
    asked = [kinds(client.requests(T0 + k * S // 10)) for k in range(1, 29)]
    assert sum(Kind.KEEP_ALIVE in kinds for kinds in asked) == 2


def test_echoes_come_quickly_at_first() -> None:
    client, echoes = connected(), 0
    for k in range(1, 200):
        now = T0 + k * 10 * MS
        for request in client.requests(now):
            kind, reader = opened(request)
            if kind == Kind.ECHO_REQUEST:
                echoes += 1
                client.hear(echo_response(Echo(read_echo_request(reader), ticks_at(now))), now + MS)
    assert echoes == pytest.approx(9 + 3, abs=1)


def test_without_an_echo_a_frame_was_captured_as_long_before_it_came_as_before_it_was_sent() -> None:
    client = NatNetClient()
    client.hear(server_info(INFO), T0)
    seen = client.hear(frame(1, T0, T0 + 5 * MS), T0 + 9 * MS)
    assert seen is not None
    assert seen.capture_ns == T0 + 4 * MS
    assert client.guessed == 1


def test_a_frame_without_a_time_of_exposure_gets_that_of_its_arrival() -> None:
    client = connected()
    never = T0 - 1000 * S
    seen = client.hear(frame(1, never, T0 + 5 * MS), T0 + 9 * MS)
    assert seen is not None
    assert seen.capture_ns == T0 + 9 * MS
    assert client.guessed == 1


@pytest.mark.parametrize("exposed_s", [-70.0, 1.5])
def test_a_frame_of_an_impossible_time_is_dropped(exposed_s: float) -> None:
    client = connected()
    assert client.hear(frame(1, T0 + round(exposed_s * S), T0), T0) is None
    assert client.refused == {"time": 1}


def test_a_repeated_frame_is_dropped() -> None:
    client = connected()
    assert client.hear(frame(1, T0, T0), T0) is not None
    assert client.hear(frame(1, T0, T0), T0) is None
    assert client.numbers.repeated == 1


def test_a_newer_server_is_asked_to_speak_what_is_read_here() -> None:
    newer = INFO._replace(version=Version(4, 3))
    client = NatNetClient()
    client.hear(server_info(newer), T0)
    words = [
        opened(request)[1].rest() for request in client.requests(T0) if opened(request)[0] == Kind.REQUEST
    ]
    assert words == [b"Bitstream,4.1\0"]
    assert client.version == (4, 3)
    client.hear(response(-1), T0)
    assert client.version == (4, 3)
    client.hear(response(0), T0)
    assert client.version == NEWEST
    assert Kind.REQUEST not in kinds(client.requests(T0 + S))


def test_an_echo_that_nobody_asked_for_is_refused() -> None:
    client = connected()
    client.hear(echo_response(Echo(T0 + 5 * S, 0)), T0 + S)
    client.hear(echo_response(Echo(0, 0)), T0 + S)
    assert client.refused == {"echo": 2}


@given(
    st.lists(
        st.one_of(st.binary(max_size=200), st.builds(packet, st.sampled_from(Kind), st.binary())), max_size=8
    )
)
def test_nothing_from_the_wire_makes_it_raise(datagrams: list[bytes]) -> None:
    for client in (NatNetClient(), connected()):
        for data in datagrams:
            client.hear(data, T0 + S)
            client.requests(T0 + S)
        assert client.hear(frame(9, T0, T0), T0 + S) is None or client.info is not None


@given(version=st.sampled_from(VERSIONS), data=st.data())
def test_damaged_datagrams_of_a_server_do_not_make_it_raise(version: Version, data: st.DataObject) -> None:
    info = INFO._replace(version=version)
    client = connected(info)
    sound = [
        frame(3, T0, T0, info),
        packet(Kind.FRAME, full_frame(version, [LEADER], 3)),
        packet(Kind.MODEL, full_model(version, {1: "leader"})),
        server_info(info),
        echo_response(Echo(T0, 17)),
    ]
    damaged = bytearray(data.draw(st.sampled_from(sound)))
    for _ in range(data.draw(st.integers(1, 5))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    client.hear(bytes(damaged), T0 + S)
    client.requests(T0 + S)
    client.hear(frame(4, T0, T0, info), T0 + S)


def test_what_is_malformed_is_counted_by_its_cause() -> None:
    client = connected()
    client.hear(b"abc", T0)
    client.hear(packet(Kind.FRAME, b"abc"), T0)
    client.hear(packet(Kind.FRAME)[:-1] + b"\1", T0)
    client.hear(packet(Kind.MODEL, b"\1\0\0\0\1\0\0\0name"), T0)
    assert client.refused == {"short": 2, "length": 1, "text": 1}
