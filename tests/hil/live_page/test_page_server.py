from __future__ import annotations

import asyncio
import contextlib
import json
import math
import signal
import time
from collections.abc import Iterator
from typing import Any

import pytest
from tornado.httpclient import HTTPClientError
from tornado.websocket import WebSocketClientConnection, WebSocketClosedError

from formation.pose import STANDSTILL, Motion, Pose
from hil.nodes.node import diagnostics
from hil.wire.message_types import String, TwistStamped
from hil.wire.messages import decode_as, encode
from hil.wire.pubsub import Wire
from tests.hil.live_page.lab_words import lab_words
from tests.hil.live_page.page_server import HUNG_UP, PATIENCE, Server, heard, live_page, say
from tests.routers import router

LEADER, FOLLOWER = Pose(1.0, 2.0, 0.3), Pose(1.2, 1.5, 0.4)
NUMBERS = [0.54, -1.4, 1.5, 0.5, 0.1, 0.02, 0.3, 1e-4]
ORDERED = ("stop", "arm", "follower/side", "leader/cmd_vel", "follower/cmd_vel")

Lab = tuple[Server, Wire]


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    with router() as (endpoint, wire), live_page(endpoint, "changing-sides") as server:
        wire.subscribe(ORDERED)
        yield server, wire


@pytest.fixture(autouse=True)
def _nothing_waits(lab: Lab) -> Iterator[None]:
    yield
    while lab[1].inbox.take(0.3) is not None:
        pass


def say_all(wire: Wire, moves: Motion = STANDSTILL, numbers: list[float] = NUMBERS) -> None:
    for topic, payload in lab_words(LEADER, FOLLOWER, moves, numbers, "because"):
        if topic not in ORDERED:
            wire.publish(topic, payload)


async def frame_with(
    socket: WebSocketClientConnection, wire: Wire, part: str, **words: Any
) -> dict[str, Any]:
    """The first frame that has something of what the lab says again and again."""
    while True:
        say_all(wire, **words)
        frame = await heard(socket, "frame")
        if frame.get(part):
            return frame


def orders_heard(wire: Wire) -> list[tuple[str, bytes]]:
    found = []
    while (event := wire.inbox.take(1.0)) is not None:
        found.append((event.topic, event.payload))
    return found


def test_a_browser_is_shown_what_the_lab_says(lab: Lab) -> None:
    server, wire = lab

    async def look() -> None:
        socket, config = await server.greeted()
        assert (config["scenario"], config["robots"], config["may_stop"]) == (
            "changing-sides",
            ["leader", "follower"],
            True,
        )
        frame = await frame_with(socket, wire, "estimate")
        assert frame["estimate"]["v1"][0] == 0.5
        assert frame["robots"][0]["pose"] == pytest.approx([*LEADER])
        frame = await frame_with(socket, wire, "reports")
        assert {"estimator", "controller"} <= {node["name"] for node in frame["reports"]["nodes"]}

    server.run(look())


def test_numbers_that_are_none_are_json_all_the_same(lab: Lab) -> None:
    server, wire = lab

    async def look() -> None:
        socket, _ = await server.greeted()
        while True:
            frame = await frame_with(
                socket, wire, "estimate", moves=Motion(math.inf, math.nan), numbers=[math.nan] * 8
            )
            if frame["estimate"]["v1"] == [None, None, None]:
                break

    server.run(look())


def test_the_lab_is_listened_to_only_while_somebody_looks(lab: Lab) -> None:
    server, wire = lab
    publisher = wire._session.declare_publisher("follower/leader_estimate")

    def wait_until(listened: bool) -> None:
        deadline = time.monotonic() + PATIENCE / 3
        while publisher.matching_status.matching != listened:  # type: ignore[attr-defined]
            assert time.monotonic() < deadline
            time.sleep(0.05)

    async def look() -> None:
        await server.greeted()
        await asyncio.to_thread(wait_until, True)
        await asyncio.to_thread(wait_until, False)

    wait_until(False)
    server.run(look())
    publisher.undeclare()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("way", ["websocket", "post"])
def test_a_stop_says_stop_and_tells_every_robot_to_stand_again_and_again(lab: Lab, way: str) -> None:
    server, wire = lab

    async def stop() -> None:
        socket, _ = await server.greeted()
        if way == "post":
            order = {"token": server.token, "order": {"say": "stop"}}
            status, said = await asyncio.to_thread(server.request, "/order", order, Origin=server.origin)
            assert (status, json.loads(said)["given"]) == (200, True)
        else:
            await say(socket, say="stop")
            answer = await heard(socket, "answer")
            assert (answer["order"], answer["given"]) == ("stop", True)
            assert "told to stop" in answer["text"]

    server.run(stop())
    said = orders_heard(wire)
    assert {topic for topic, _ in said} == {"stop", "leader/cmd_vel", "follower/cmd_vel"}
    reasons = [decode_as(payload, String).data for topic, payload in said if topic == "stop"]
    assert set(reasons) == {"stopped by hand on the live page"}
    assert len(reasons) >= 5
    twists = [decode_as(payload, TwistStamped).twist for topic, payload in said if topic != "stop"]
    assert {(twist.linear.x, twist.angular.z) for twist in twists} == {(0.0, 0.0)}


def test_all_who_look_are_told_what_came_of_a_stop(lab: Lab) -> None:
    server, _ = lab

    async def stop() -> None:
        other, _ = await server.greeted()
        socket, _ = await server.greeted()
        await say(socket, say="stop")
        for each in (socket, other):
            assert (await heard(each, "stop"))["state"] == "told"
            news = await heard(each, "stop")
            assert news["state"] == "failed"
            assert "nothing was heard of leader, follower" in news["text"]

    server.run(stop())


def test_robots_are_armed_and_sent_to_a_side_by_their_topics(lab: Lab) -> None:
    server, wire = lab

    async def order() -> None:
        socket, _ = await server.greeted()

        async def answer_to(**word: Any) -> dict[str, Any]:
            # On a busy machine an order may be late, as it says.
            while True:
                await say(socket, frame=(await heard(socket, "frame"))["n"], **word)
                answer = await heard(socket, "answer")
                if "give the order again" not in answer["text"]:
                    return answer

        for word in ({"say": "arm"}, {"say": "arm", "robot": "leader"}, {"say": "side", "side": "left"}):
            answer = await answer_to(**word)
            assert answer["given"], answer
        answer = await answer_to(say="arm", robot="nobody")
        assert (answer["given"], answer["text"]) == (False, "there is no robot 'nobody'")

    server.run(order())
    said = [(topic, decode_as(payload, String).data) for topic, payload in orders_heard(wire)]
    assert sorted(said) == [("arm", ""), ("arm", "leader"), ("follower/side", "left")]


def test_an_order_from_before_a_stop_of_somebody_else_is_refused_by_either_way(lab: Lab) -> None:
    server, wire = lab

    async def order() -> None:
        socket, _ = await server.greeted()
        late = {"say": "arm", "frame": (await heard(socket, "frame"))["n"]}
        reports: dict[str, Any] = {}
        while (reports.get("stop") or {}).get("reason") != "by another":
            wire.publish("stop", encode(String(data="by another")))
            reports = (await heard(socket, "frame")).get("reports", {})
        await say(socket, **late)
        answer = await heard(socket, "answer")
        assert not answer["given"]
        assert "a stop was given since" in answer["text"]
        post = {"token": server.token, "order": late}
        status, said = await asyncio.to_thread(server.request, "/order", post, Origin=server.origin)
        assert (status, json.loads(said)["text"]) == (200, answer["text"])

    server.run(order())
    assert "arm" not in {topic for topic, _ in orders_heard(wire)}


def test_whom_we_hang_up_on_looks_on_no_more_whatever_it_still_says(lab: Lab) -> None:
    server, _ = lab

    async def talk() -> None:
        socket = await server.connect()
        await socket.write_message("junk")
        # It may be told already.
        with contextlib.suppress(WebSocketClosedError):
            await say(socket, say="hello", token=server.token)
        assert await socket.read_message() is None
        assert socket.close_code == 4400

    server.run(talk())


def test_pages_of_others_are_refused_and_that_is_said(lab: Lab) -> None:
    server, wire = lab
    stop = {"token": server.token, "order": {"say": "stop"}}
    for headers in ({}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
        assert server.request("/order", stop, **headers)[0] == 403
    for path in ("/", "/page.js", "/token", "/lab", "/order"):
        assert server.request(path, Host="evil.example")[0] == 403
    assert server.request("/order", stop, Host="evil.example", Origin="http://evil.example")[0] == 403
    wrong = {"token": "wrong", "order": {"say": "stop"}}
    assert server.request("/order", wrong, Origin=server.origin)[0] == 403

    async def knock() -> None:
        for headers in (
            {"Origin": "http://evil.example"},
            {"Host": "evil.example", "Origin": "http://evil.example"},
        ):
            with pytest.raises(HTTPClientError, match="403"):
                await server.connect(**headers)
        socket, _ = await server.greeted()
        frame = await frame_with(socket, wire, "reports")
        assert {"origin", "host", "token"} <= frame["reports"]["refused"].keys()

    server.run(knock())
    assert orders_heard(wire) == []


def test_what_is_no_word_of_a_browser_ends_the_talk_and_nothing_else(lab: Lab) -> None:
    server, wire = lab
    huge = b'{"token":"' + b"x" * 100_000 + b'"}'
    assert server.request("/order", b"{}", Origin=server.origin)[0] == 400
    assert server.request("/order", b"\xff" * 100, Origin=server.origin)[0] == 400
    assert server.request("/order", huge, Origin=server.origin)[0] in (HUNG_UP, 400, 413)
    for path in ("/../page_server.py", "/page_server.py", "/%2e%2e/pyproject.toml", "/" + "x" * 60_000):
        assert server.request(path)[0] in (HUNG_UP, 400, 404)

    async def talk() -> None:
        watcher, _ = await server.greeted()
        for words in (
            ["junk"],
            [b"\xff\x00"],
            ["x" * 100_000],
            ['{"say":"stop"}'],
            ['{"say":"hello","token":"no"}'],
        ):
            socket = await server.connect()
            for word in words:
                await socket.write_message(word, binary=isinstance(word, bytes))
            assert await socket.read_message() is None
        flooder, _ = await server.greeted()
        with contextlib.suppress(WebSocketClosedError):
            for _ in range(1000):
                await say(flooder, say="look", follower=0)
        with pytest.raises(AssertionError, match="flood"):
            await heard(flooder, "answer")
        frame = await frame_with(watcher, wire, "estimate")
        assert frame["estimate"]["status"] == "tracking"

    server.run(talk())
    assert orders_heard(wire) == []


def test_a_browser_that_sees_nothing_is_sent_little(lab: Lab) -> None:
    server, wire = lab

    async def look() -> None:
        slow, _ = await server.greeted()
        quick, _ = await server.greeted()
        for _ in range(20):
            await frame_with(quick, wire, "estimate")
        frames = 0
        while True:
            try:
                await asyncio.wait_for(slow.read_message(), 1.0)
            except TimeoutError:
                break
            frames += 1
        assert frames <= 3

    server.run(look())


def test_no_more_browsers_than_are_worth_it_are_let_in(lab: Lab) -> None:
    server, wire = lab

    async def crowd() -> None:
        first, _ = await server.greeted()
        # Those of the tests before may still be on their way out.
        while (await frame_with(first, wire, "reports"))["reports"]["browsers"] > 1:
            pass
        for _ in range(15):
            await server.greeted()
        with pytest.raises(HTTPClientError, match="503"):
            await server.greeted()

    server.run(crowd())


def test_a_page_that_is_ended_says_good_bye() -> None:
    with router() as (endpoint, _), live_page(endpoint) as server:

        async def look() -> None:
            socket, _ = await server.greeted()
            server.process.send_signal(signal.SIGTERM)
            await heard(socket, "bye")

        server.run(look())
        assert server.process.wait(timeout=60.0) == 0


def test_elsewhere_the_token_comes_with_the_address_only() -> None:
    with router() as (endpoint, wire), live_page(endpoint, "--live-address", "0.0.0.0") as server:
        assert len(server.token) >= 16
        server.address = f"http://127.0.0.1:{urlsplit_port(server.address)}/"
        status, content = server.request("/token")
        assert (status, server.token.encode() in content) == (404, False)

        async def look() -> None:
            socket, _ = await server.greeted()
            await frame_with(socket, wire, "estimate")
            stranger = await server.connect()
            await say(stranger, say="hello", token="x" * len(server.token))
            assert await stranger.read_message() is None
            assert stranger.close_code == 4403

        server.run(look())


def urlsplit_port(address: str) -> int:
    return int(address.rpartition(":")[2].strip("/"))


def test_a_router_that_is_gone_is_told_and_no_order_is_said_to_be_given() -> None:
    with router() as (endpoint, _):
        pages = live_page(endpoint)
        server = pages.__enter__()

    async def look() -> None:
        socket, _ = await server.greeted()
        while True:
            frame = await heard(socket, "frame")
            if "reports" in frame and not frame["reports"]["link"]:
                break
        await say(socket, say="stop")
        answer = await heard(socket, "answer")
        assert not answer["given"]
        assert "router is not reached" in answer["text"]

    try:
        server.run(look())
    finally:
        pages.__exit__(None, None, None)


def test_whoever_arms_reads_why_a_guard_holds_its_robot(lab: Lab) -> None:
    server, wire = lab
    held = diagnostics("guard/follower", 5, "latched (stopped): by hand; arm it", {"latched": "stopped"})

    async def look() -> None:
        socket, _ = await server.greeted()
        while True:
            wire.publish("diagnostics", encode(held))
            frame = await heard(socket, "frame")
            if frame.get("reports", {}).get("guards"):
                break
        assert frame["reports"]["guards"] == {"follower": "latched (stopped): by hand; arm it"}

    server.run(look())
