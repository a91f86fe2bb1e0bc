"""What a real Motive 2.1 streamed: read as it was captured, and played over loopback into the bridge."""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path

import pytest

from hil.bridge.mocap_wire import MocapWire
from hil.bridge.natnet_bridge import NatNetBridge, Server
from hil.bridge.natnet_frame import Frame, read_frame
from hil.bridge.natnet_model import read_model
from hil.bridge.natnet_packets import Kind, ServerInfo, Version, opened, read_echo, read_echo_request
from hil.bridge.server_clock import ServerClock
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import DiagnosticArray, RigidBodies
from hil.wire.messages import decode_as, to_ns
from tests.hil.bridge.natnet_peers import Captured, Player, captured, playing

pytestmark = pytest.mark.real

VERSION = Version(3, 0)
PATIENCE = 60.0
MS = 1e-6


@pytest.fixture(scope="module")
def datagrams() -> list[Captured]:
    return captured(Path(os.environ["ABREAST_REAL"]) / "natnet3_motive21.pcapng")


def frames_in(datagrams: list[Captured]) -> list[tuple[int, Frame]]:
    return [
        (datagram.at_ns, read_frame(opened(datagram.data)[1], VERSION))
        for datagram in datagrams
        if datagram.data[0] == Kind.FRAME
    ]


def echoed(datagrams: list[Captured], frequency: int) -> ServerClock:
    """The clock by the echoes that the capture has in it."""
    clock, asked = ServerClock(frequency), dict[int, int]()
    for datagram in datagrams:
        if datagram.data[0] == Kind.ECHO_REQUEST:
            asked[read_echo_request(opened(datagram.data)[1])] = datagram.at_ns
        elif datagram.data[0] == Kind.ECHO_RESPONSE:
            echo = read_echo(opened(datagram.data)[1])
            assert clock.hear(asked[echo.asked], datagram.at_ns, echo.ticks)
    return clock


def spread_and_drift(delays: list[float]) -> tuple[float, float]:
    """Standard deviation, and by how much the last hundred are above the first."""
    return statistics.pstdev(delays), statistics.mean(delays[-100:]) - statistics.mean(delays[:100])


def test_every_frame_is_read_to_its_last_byte(datagrams: list[Captured]) -> None:
    frames = [frame for _, frame in frames_in(datagrams)]
    assert [frame.number for frame in frames] == list(range(162_734, 163_252))
    assert {tuple(body.id for body in frame.bodies) for frame in frames} == {(2,)}
    assert all(frame.bodies[0].tracked for frame in frames)
    # Y up: a quadrotor in the hand, at the height of a chest.
    heights = [frame.bodies[0].position[1] for frame in frames]
    assert 1.0 < min(heights) < max(heights) < 2.0
    (model,) = (datagram for datagram in datagrams if datagram.data[0] == Kind.MODEL)
    assert read_model(opened(model.data)[1], VERSION) == {2: "RaceQuad"}


def test_times_are_those_that_were_measured_on_it(datagrams: list[Captured]) -> None:
    frames = frames_in(datagrams)
    clock = echoed(datagrams, 3_312_787)
    raw = [(at_ns - clock.nanoseconds(frame.exposed)) * MS for at_ns, frame in frames]
    assert spread_and_drift(raw) == pytest.approx((0.378, 0.64), abs=0.01)
    sending = [clock.nanoseconds(frame.sent - frame.exposed) * MS for _, frame in frames]
    assert statistics.median(sending) == pytest.approx(5.4, abs=0.01)
    # By the echoes the clocks stay together to 20 ppm: what drifts is the way, not the clock.
    delays = [(at_ns - clock.host_ns(frame.exposed)) * MS for at_ns, frame in frames]
    assert 5.4 < min(delays) < statistics.median(delays) < 7.5
    assert abs(clock.drift) < 20e-6


def test_played_over_loopback_all_of_it_arrives_with_the_times_of_exposure(datagrams: list[Captured]) -> None:
    player, said = Player(datagrams), list[str]()
    scenario = load_scenario("turtlebot3", ['leader.body="RaceQuad"'])
    with playing(player) as port:
        wire = MocapWire("bridge/natnet", scenario, "y", said.append)
        bridge = NatNetBridge(Server("127.0.0.1", port), wire, said.append)
        try:
            out: list[Outgoing] = []
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until and sum(each.topic == topics.RIGID_BODIES for each in out) < 518:
                bridge.wait(0.05)
                out += bridge.take(time.time_ns())
            out += bridge.end(time.time_ns())
        finally:
            bridge.close()
    frames = [decode_as(each.payload, RigidBodies) for each in out if each.topic == topics.RIGID_BODIES]
    assert [frame.frame_number for frame in frames] == list(range(162_734, 163_252))
    assert {body.rigid_body_name for frame in frames for body in frame.rigidbodies} == {"RaceQuad"}
    (status,) = decode_as(out[-1].payload, DiagnosticArray).status
    values = {entry.key: entry.value for entry in status.values}
    assert (values["frames"], values["missed"], values["stamped_by_arrival"]) == ("518", "0", "0")
    assert not any(key.startswith("refused") for key in values)
    exposed = [player.host_ns(frame.exposed) for _, frame in frames_in(datagrams)]
    errors = [to_ns(frame.header.stamp) - at_ns for frame, at_ns in zip(frames, exposed, strict=True)]
    assert statistics.median(map(abs, errors)) * MS < float(values["clock.round_trip_ms"]) + 0.05
    assert said[:3] == [
        f"waiting for an answer of 127.0.0.1:{port}",
        "Motive 2.1.0.0 answers, NatNet 3.0, multicast to 239.255.42.99:1511",
        "the model has 'RaceQuad' (2)",
    ]


def test_its_server_is_known(datagrams: list[Captured]) -> None:
    assert Player(datagrams).info == ServerInfo("Motive", "2.1.0.0", VERSION, 3_312_787, 1511, True)
