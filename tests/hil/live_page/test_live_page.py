from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from hil.live.daemon import Ending
from hil.live_page import order_line
from hil.live_page.admission import Admission
from hil.live_page.browser_words import Arm, Stop
from hil.live_page.live_page import LivePage, Viewer
from hil.live_page.serving import bound, serve
from hil.live_page.shown_lab import ShownLab
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.message_types import String
from hil.wire.messages import decode_as
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from tests.hil.live_page.page_server import heard, live_page, say
from tests.tls_labs import lab_keys, tls_lab

SCENARIO = load_scenario("turtlebot3")


def with_page(
    talk: Callable[[LivePage], Coroutine[Any, Any, None]], allowed: frozenset[str] | None = None
) -> list[str]:
    """Let a page be talked with in a lab that is a router alone; what its terminal reads."""
    lines: list[str] = []
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
    other = open_session(Endpoints(connect=endpoint))

    async def go() -> None:
        page = LivePage(session, SCENARIO, Admission("t" * 20), allowed, lines.append)
        try:
            await talk(page)
        finally:
            page.close()

    try:
        asyncio.run(go())
    finally:
        close_session(other)
        close_session(session)
    return lines


def test_what_cannot_be_drawn_stops_no_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ShownLab, "motion", lambda *_: 1 / 0)
    ending = Ending()

    async def talk(page: LivePage) -> None:
        page.enter(Viewer(lambda _: None, lambda: None))
        serving = asyncio.ensure_future(serve(page, bound("127.0.0.1", 0), ending))
        await asyncio.sleep(0.3)
        given, text = await page.order(Stop())
        assert given, text
        assert not serving.done()
        ending.ask()
        await serving

    lines = with_page(talk)
    assert lines == [lines[0]]
    assert "ZeroDivisionError" in lines[0]


def test_keys_that_let_nobody_stop_are_said_and_nothing_is_told() -> None:
    async def talk(page: LivePage) -> None:
        told: list[dict[str, Any]] = []
        page.enter(Viewer(lambda text: told.append(json.loads(text)), lambda: None))
        assert told[0]["may_stop"] is False
        for order in (Arm(frame=page._frames.next(time.monotonic())), Stop()):
            given, text = await page.order(order)
            assert not given
            assert "our keys do not let us" in text

    with_page(talk, allowed=frozenset())


def test_a_browser_that_sees_nothing_for_long_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    async def talk(page: LivePage) -> None:
        left: list[bool] = []
        page.enter(Viewer(lambda _: None, lambda: left.append(True)))
        begun = time.monotonic()
        monkeypatch.setattr(page, "_clock", lambda: begun)
        page.go_round()
        assert not left
        monkeypatch.setattr(page, "_clock", lambda: begun + 20.0)
        page.go_round()
        assert left
        assert page._viewers == [], "it counts no longer, though its connection never ends"

    with_page(talk)


def test_an_order_that_comes_after_a_stop_is_refused_until_a_frame_was_seen_since() -> None:
    async def talk(page: LivePage) -> None:
        told: list[dict[str, Any]] = []
        page.enter(Viewer(lambda text: told.append(json.loads(text)), lambda: None))
        page.go_round()
        late = Arm(frame=told[-1]["n"])
        assert (await page.order(late))[0]
        assert (await page.order(Stop()))[0]
        assert await page.order(late) == (False, page._frames.refusal(late.frame, time.monotonic()))
        page.go_round()
        frames = [each for each in told if each["kind"] == "frame"]
        assert frames[-1]["n"] > late.frame

    with_page(talk)


def test_an_order_that_cannot_be_said_is_not_said_to_be_told(monkeypatch: pytest.MonkeyPatch) -> None:
    async def talk(page: LivePage) -> None:
        def broken(*_: object) -> None:
            raise OSError("broken")

        monkeypatch.setattr(page._orders._wire, "publish", broken)
        arm = Arm(frame=page._frames.next(time.monotonic()))
        assert await page.order(arm) == (False, "not told: broken")
        assert await page.order(Stop()) == (False, "not told: broken; use the robot's switch")

    with_page(talk)


def test_a_stop_goes_ahead_of_orders_that_are_stuck_and_drops_those_that_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def talk(page: LivePage) -> None:
        free, publish = threading.Event(), page._orders._wire.publish
        said: list[str] = []

        def stuck(topic: str, payload: bytes) -> None:
            said.append(topic)
            if topic == topics.ARM:
                free.wait(60.0)
            publish(topic, payload)

        monkeypatch.setattr(page._orders._wire, "publish", stuck)
        arm = Arm(frame=page._frames.next(time.monotonic()))
        arming = [asyncio.ensure_future(page.order(arm)) for _ in range(8)]
        await asyncio.sleep(0.1)
        assert (await page.order(Stop()))[0]
        answers = [await each for each in arming]
        free.set()
        assert answers == [(False, "not known whether it was told")] + 7 * [
            (False, "not told: a stop came first")
        ]
        assert said.count(topics.ARM) == 1

    with_page(talk)


def test_what_came_of_a_stop_is_told_where_it_cannot_be_known(monkeypatch: pytest.MonkeyPatch) -> None:
    async def talk(page: LivePage) -> None:
        told: list[dict[str, Any]] = []
        page.enter(Viewer(lambda text: told.append(json.loads(text)), lambda: None))
        monkeypatch.setattr(order_line, "stop_all", lambda *_: 1 / 0)
        assert (await page.order(Stop()))[0]
        while told[-1].get("state") != "failed":
            await asyncio.sleep(0.01)
        assert "not known what came of it" in told[-1]["text"]
        assert "use the robot's switch" in told[-1]["text"]

    with_page(talk)


def test_with_keys_a_token_is_needed_here_too_and_a_stop_goes_out(tmp_path: Path) -> None:
    scenario = lab_keys(tmp_path)
    with tls_lab(tmp_path) as lab:
        wire = lab.wire("recorder", scenario)
        wire.subscribe(["stop"])
        with live_page(lab.endpoint, "--secure", str(tmp_path)) as server:
            assert server.token
            assert server.request("/token")[0] == 404

            async def stop() -> None:
                socket, config = await server.greeted()
                assert config["may_stop"]
                await say(socket, say="stop")
                assert (await heard(socket, "answer"))["given"]

            server.run(stop())
            event = wire.inbox.take(60.0)
            assert event is not None
            assert decode_as(event.payload, String).data == "stopped by hand on the live page"


def test_what_came_while_nobody_looked_is_not_new_to_who_looks_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async def talk(page: LivePage) -> None:
        told: list[dict[str, Any]] = []
        viewer = Viewer(lambda text: told.append(json.loads(text)), lambda: None)
        begun = time.monotonic()
        monkeypatch.setattr(page, "_clock", lambda: begun)
        page.enter(viewer)
        page.go(viewer)
        event = Event("follower/odom", b"", None)
        monkeypatch.setattr(page._newest, "take", lambda coming=[[event]]: coming.pop() if coming else [])
        page.go_round()
        monkeypatch.setattr(page, "_clock", lambda: begun + 4.0)
        page.enter(Viewer(viewer.send, lambda: None))
        page.go_round()
        assert told[-1]["robots"][1]["own_age"] == 4.0

    with_page(talk)
