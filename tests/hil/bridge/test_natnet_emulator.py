"""The emulated Motive and the bridge, on loopback: what one sends is what the other publishes, and when."""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hil.bridge.datagram_sockets import open_socket
from hil.bridge.mocap_wire import MocapWire
from hil.bridge.natnet_bridge import NatNetBridge, Server
from hil.bridge.natnet_emulator import NatNetEmulator, Serving, run_alone
from hil.bridge.natnet_packets import VERSIONS, Kind, Version, packet
from hil.emulator.node import EmulatorNode
from hil.errors import AbreastError
from hil.live.daemon import Ending
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.message_types import DiagnosticArray, RigidBodies
from hil.wire.messages import decode_as, to_ns

PATIENCE = 120.0
MS = 1e-6


class Kept(NatNetEmulator):
    """Keeps the frames that it serves, as the emulator made them."""

    def __init__(self, scenario: Scenario, serving: Serving) -> None:
        super().__init__(EmulatorNode(scenario), serving, alone=True)
        self.frames: dict[int, RigidBodies] = {}

    def _serve(self, payload: bytes) -> None:
        frame = decode_as(payload, RigidBodies)
        self.frames[frame.frame_number] = frame
        super()._serve(payload)


@contextmanager
def emulator(scenario: Scenario, version: Version, multicast: bool = False) -> Iterator[Kept]:
    """One that is alone, on free ports of loopback."""
    served = Kept(scenario, Serving("127.0.0.1", version, 0, 0, multicast))
    ending, ready = Ending(), threading.Event()
    thread = threading.Thread(target=run_alone, args=(served, ending, None, ready.set))
    thread.start()
    try:
        assert ready.wait(PATIENCE)
        yield served
    finally:
        ending.ask()
        thread.join()


def bridged(
    scenario: Scenario, port: int, count: int, said: list[str]
) -> tuple[list[RigidBodies], dict[str, str]]:
    """So many frames by the bridge, and what its last diagnostics tell."""
    return published(MocapWire("bridge/natnet", scenario, None, said.append), port, count, said)


def published(
    wire: MocapWire, port: int, count: int, said: list[str]
) -> tuple[list[RigidBodies], dict[str, str]]:
    """The same by a wire of one's own."""
    bridge = NatNetBridge(Server("127.0.0.1", port), wire, said.append)
    out: list[Outgoing] = []
    until = time.monotonic() + PATIENCE
    try:
        while sum(each.topic == topics.RIGID_BODIES for each in out) < count and time.monotonic() < until:
            bridge.wait(0.05)
            out += bridge.take(time.time_ns())
        out += bridge.end(time.time_ns())
    finally:
        bridge.close()
    frames = [decode_as(each.payload, RigidBodies) for each in out if each.topic == topics.RIGID_BODIES]
    (status,) = decode_as(out[-1].payload, DiagnosticArray).status
    return frames, {entry.key: entry.value for entry in status.values}


CASES = [(version, False) for version in VERSIONS] + [(VERSIONS[1], True), (VERSIONS[3], True)]


@pytest.mark.parametrize(("version", "multicast"), CASES)
def test_frames_come_through_with_their_poses_and_times(version: Version, multicast: bool) -> None:
    # A clock that is wrong by a minute and drifts: its readings come out as host time all the same.
    clock = ["mocap.clock_offset_s=60.0", "mocap.clock_drift_ppm=50.0", "mocap.latency_s=0.005"]
    scenario = load_scenario("turtlebot3", ['leader.body="Leader\'s"', "follower.body=2", *clock])
    said: list[str] = []
    with emulator(scenario, version, multicast) as served:
        frames, values = bridged(scenario, served.command_port, 200, said)
    assert "waiting for an answer" in said[0]
    assert f"NatNet {version}, {'multicast to' if multicast else 'unicast'}" in said[1]
    assert said[2] == """the model has "Leader's" (1), '2' (2)"""
    assert values["missed"] == values["repeated"] == "0"
    # Those that come before the first echo.
    assert int(values["stamped_by_arrival"]) < 20
    offsets = []
    for frame in frames:
        made = served.frames[frame.frame_number]
        assert [body.rigid_body_name for body in frame.rigidbodies] == ["Leader's", "2"]
        for body, origin in zip(frame.rigidbodies, made.rigidbodies, strict=True):
            assert body.pose.position.x == pytest.approx(origin.pose.position.x, abs=1e-7)
            assert body.pose.position.y == pytest.approx(origin.pose.position.y, abs=1e-7)
            assert body.pose.orientation.z == pytest.approx(origin.pose.orientation.z, abs=1e-7)
        offsets.append((to_ns(made.header.stamp) - to_ns(frame.header.stamp)) * MS)
    assert statistics.median(offsets) == pytest.approx(
        60_000.0, abs=1.0 + float(values["clock.round_trip_ms"])
    )


def test_it_streams_y_up_where_the_scenario_has_it_so() -> None:
    scenario = load_scenario("turtlebot3", ['source.up="y"'])
    with emulator(scenario, VERSIONS[3]) as served:
        wire = MocapWire("bridge/natnet", load_scenario("turtlebot3"), "y", lambda _: None)
        frames, _ = published(wire, served.command_port, 20, [])
    for frame in frames:
        for body, origin in zip(
            frame.rigidbodies, served.frames[frame.frame_number].rigidbodies, strict=True
        ):
            assert body.pose.position.x == pytest.approx(origin.pose.position.x, abs=1e-7)
            assert body.pose.position.y == pytest.approx(origin.pose.position.y, abs=1e-7)
            assert body.pose.orientation.z == pytest.approx(origin.pose.orientation.z, abs=1e-7)


def test_alone_the_leader_drives_and_the_follower_stands() -> None:
    scenario = load_scenario("turtlebot3")
    with emulator(scenario, VERSIONS[0]) as served:
        frames, _ = bridged(scenario, served.command_port, 240, [])
    (leader, follower), (leader_later, follower_later) = (
        [body.pose.position for body in frame.rigidbodies] for frame in (frames[0], frames[-1])
    )
    assert abs(leader.x - leader_later.x) + abs(leader.y - leader_later.y) > 0.05
    assert abs(follower.x - follower_later.x) + abs(follower.y - follower_later.y) < 0.001


def test_strangers_and_what_is_malformed_are_counted_and_said_once() -> None:
    said: list[str] = []
    scenario = load_scenario("turtlebot3")
    with open_socket("127.0.0.1") as server, open_socket("127.0.0.2") as stranger:
        wire = MocapWire("bridge/natnet", scenario, None, said.append)
        bridge = NatNetBridge(Server("127.0.0.1", server.getsockname()[1]), wire, said.append)
        try:
            list(bridge.take(time.time_ns()))
            until = time.monotonic() + PATIENCE
            asked = None
            while asked is None and time.monotonic() < until:
                try:
                    asked = server.recvfrom(2048)[1]
                except BlockingIOError:
                    time.sleep(0.01)
            assert asked is not None
            for _ in range(3):
                server.sendto(packet(Kind.SERVER_INFO, b"short"), asked)
                stranger.sendto(b"", asked)
            values: dict[str, str] = {}
            while values.get("refused.short") != "3" and time.monotonic() < until:
                bridge.wait(0.05)
                list(bridge.take(time.time_ns()))
                (last,) = bridge.end(time.time_ns())
                (status,) = decode_as(last.payload, DiagnosticArray).status
                values = {entry.key: entry.value for entry in status.values}
        finally:
            bridge.close()
    assert (values["refused.short"], values["refused.stranger"]) == ("3", "3")
    assert sum("drops what is malformed or not meant for it: short" in line for line in said) == 1


def test_a_server_that_is_too_old_is_refused_in_one_line() -> None:
    scenario = load_scenario("turtlebot3")
    with emulator(scenario, Version(3, 0)) as served:
        served.info = served.info._replace(version=Version(2, 10))
        served._service.info = served.info
        with pytest.raises(AbreastError, match=r"streams NatNet 2\.10, expected 3\.0 to 4\.1"):
            bridged(scenario, served.command_port, 1, [])


def test_a_port_that_is_taken_is_told() -> None:
    with open_socket("127.0.0.1") as taken:
        port = taken.getsockname()[1]
        serving = Serving("127.0.0.1", VERSIONS[0], port, 0)
        with pytest.raises(AbreastError, match=rf"UDP 127\.0\.0\.1:{port}: Address already in use"):
            NatNetEmulator(EmulatorNode(load_scenario("turtlebot3")), serving)
