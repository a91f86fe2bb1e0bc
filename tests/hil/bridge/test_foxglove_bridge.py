"""The wire served to Foxglove, seen by a client of its WebSocket protocol."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any

import pytest
from mcap_ros2._dynamic import generate_dynamic
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from hil.bridge.bridging import run_bridge
from hil.bridge.foxglove_bridge import FoxgloveBridge
from hil.errors import AbreastError, UsageError
from hil.live.daemon import Ending
from hil.log.reader import Log
from hil.scenario.files import load_scenario
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints
from tests.routers import router

PROTOCOL = "foxglove.sdk.v1"
MESSAGE, _HEAD_BYTES = 1, 13  # opcode, subscription, time of the log


@contextmanager
def served(endpoint: str, port: int = 0) -> Iterator[str]:
    """The bridge at work on a router; where it serves."""
    scenario, ending, there = load_scenario("turtlebot3"), Ending(), threading.Event()
    bridges: list[FoxgloveBridge] = []

    def bridge(wire: Wire) -> FoxgloveBridge:
        bridges.append(FoxgloveBridge(wire, scenario, "127.0.0.1", port))
        return bridges[0]

    arguments = (bridge, scenario, Endpoints(connect=endpoint), ending, 60.0, there.set)
    thread = threading.Thread(target=run_bridge, args=arguments)
    thread.start()
    try:
        assert there.wait(30.0)
        yield bridges[0].url
    finally:
        ending.ask()
        thread.join()


class Viewer:
    """What Foxglove does, in short: hears of channels, subscribes to some, and reads by their schemas."""

    def __init__(self, url: str) -> None:
        self._url = url
        self.channels: dict[str, Any] = {}
        self.seen: dict[str, list[Any]] = {}
        self._numbers: dict[int, str] = {}

    async def look(self, wanted: tuple[str, ...], say: Callable[[], None], enough: int) -> None:
        """Subscribe to topics, and take in messages while ``say`` is called, until each has enough."""
        link = await websocket_connect(HTTPRequest(self._url), subprotocols=[PROTOCOL])
        talk = asyncio.create_task(self._talk(say))
        try:
            assert link.selected_subprotocol == PROTOCOL
            while any(len(self.seen.get(topic, ())) < enough for topic in wanted):
                said = await asyncio.wait_for(link.read_message(), 20.0)
                if isinstance(said, bytes) and said[0] == MESSAGE:
                    topic = self._numbers[int.from_bytes(said[1:5], "little")]
                    self.seen.setdefault(topic, []).append(self._read(topic, said[_HEAD_BYTES:]))
                elif isinstance(said, str) and json.loads(said)["op"] == "advertise":
                    asked = self._subscribed(json.loads(said)["channels"], wanted)
                    await link.write_message(json.dumps({"op": "subscribe", "subscriptions": asked}))
        finally:
            talk.cancel()
            link.close()
            await asyncio.sleep(0.2)

    async def _talk(self, say: Callable[[], None]) -> None:
        while True:
            say()
            await asyncio.sleep(0.01)

    def _subscribed(self, channels: list[Any], wanted: tuple[str, ...]) -> list[dict[str, int]]:
        self.channels |= {each["topic"]: each for each in channels}
        asked = {each["id"]: each["topic"] for each in channels if each["topic"] in wanted}
        self._numbers |= asked
        return [{"id": number, "channelId": number} for number in asked]

    def _read(self, topic: str, payload: bytes) -> Any:
        told = self.channels[topic]
        assert (told["encoding"], told["schemaEncoding"]) == ("cdr", "ros2msg")
        return generate_dynamic(told["schemaName"], told["schema"])[told["schemaName"]](payload)


def test_a_viewer_sees_topics_transforms_and_the_scene(short_log: Log) -> None:
    wanted = ("/rigid_bodies", "/follower/leader_estimate", "/tf", "/scene")
    topics = ["rigid_bodies", "follower/leader_estimate", "follower/command"]
    middle_ns = ((short_log.start_ns or 0) + (short_log.end_ns or 0)) // 2
    records = short_log.records(topics, start_ns=middle_ns)
    with router() as (endpoint, mouth), served(endpoint) as url:

        def say() -> None:
            for record in islice(records, 3):
                mouth.publish(record.topic, record.payload)

        viewer = Viewer(url)
        asyncio.run(viewer.look(wanted, say, 3))
    assert viewer.channels.keys() >= {"/follower/odom", "/diagnostics", "/stop", "/truth", *wanted}
    bodies = viewer.seen["/rigid_bodies"][0].rigidbodies
    assert {each.rigid_body_name for each in bodies} == {"leader", "follower"}
    assert viewer.seen["/follower/leader_estimate"][0].status == 1
    assert {each.child_frame_id for each in viewer.seen["/tf"][0].transforms} == {"leader", "follower"}
    assert any("mm/s" in each.text for each in viewer.seen["/scene"][-1].markers)


def test_a_port_that_is_taken_is_told() -> None:
    with router() as (endpoint, wire), served(endpoint) as url:
        port = int(url.rpartition(":")[2])
        with pytest.raises(AbreastError, match=f"cannot serve at 127.0.0.1:{port} .*--port"):
            FoxgloveBridge(wire, load_scenario("turtlebot3"), "127.0.0.1", port)


def test_without_the_extra_it_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with router() as (_, wire), pytest.raises(UsageError, match=r"pip install 'abreast\[foxglove\]'"):
        FoxgloveBridge(wire, load_scenario("turtlebot3"), "127.0.0.1", 0)
