"""The page in a browser: what is seen of a lab, what it does, and what it says when nothing comes."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.keys import Keys

from formation.pose import STANDSTILL, Motion, Pose
from hil.wire import topics
from hil.wire.message_types import String
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from tests.hil.live_page.lab_words import lab_words
from tests.hil.live_page.page_server import Server, live_page
from tests.hil.live_page.watched_page import WatchedPage
from tests.routers import router

LEADER, FOLLOWER = Pose(1.0, 2.0, 0.3), Pose(1.2, 1.5, 0.4)
NUMBERS = [0.54, -1.4, 1.5, 0.5, 0.1, 0.02, 0.3, 1e-4]


@contextmanager
def talking(wire: Wire, moves: Motion = STANDSTILL, text: str = "") -> Iterator[None]:
    """A lab that says all it has to say twenty times a second, but no stop."""
    over = threading.Event()

    def talk() -> None:
        while not over.wait(0.05):
            for topic, payload in lab_words(LEADER, FOLLOWER, moves, NUMBERS, text):
                if topic != topics.STOP:
                    wire.publish(topic, payload)

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.fixture
def lab() -> Iterator[tuple[Server, Wire]]:
    with router() as (endpoint, wire), live_page(endpoint, "changing-sides") as server:
        wire.subscribe([topics.STOP, topics.ARM, "follower/side"])
        yield server, wire


def heard(wire: Wire, topic: str) -> str:
    """What is said next on a topic."""
    while (event := wire.inbox.take(60.0)) is not None:
        if event.topic == topic:
            return decode_as(event.payload, String).data
    raise AssertionError(topic)


@pytest.mark.parametrize("width", [390, 1280])
def test_a_lab_is_seen_on_a_phone_and_at_a_desk_and_fits(
    lab: tuple[Server, Wire], chrome: Chrome, width: int
) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address, width)
    with talking(wire, Motion(0.2, -0.1), '<img src="x" onerror="alert(1)">'):
        page.wait_until(page.is_live)
        page.wait_until(lambda: min(page.colours()) >= 1)
        page.wait_until(lambda: "estimator" in page.text("nodes"))
        for name, words in {
            "verdict": "tracking",
            "against": 'axes: <img src="x" onerror="alert(1)">',
            "nodes": "7 tilted",
            "robots": "+0.200, ",
            "side": "the follower on the left, side change under way",
        }.items():
            assert words in page.text(name), name
        assert page.script("return document.documentElement.scrollWidth") <= width
        height, below = page.script(
            "const box = document.getElementById('stop').getBoundingClientRect();"
            "return [box.height, box.bottom - innerHeight]"
        )
        assert height >= 70
        assert below <= 0
        fetched = page.script("return performance.getEntriesByType('resource').map(each => each.name)")
        assert all(each.startswith(server.address) for each in fetched)
    assert page.errors() == []


def test_the_space_bar_stops_wherever_the_focus_is_and_presses_nothing_else(
    lab: tuple[Server, Wire], chrome: Chrome
) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address)
    with talking(wire):
        page.wait_until(page.is_live)
        page.wait_until(lambda: page.button("Arm all").is_enabled())
        page.script("document.querySelector('#orders button').focus()")
        page.press(Keys.SPACE)
        page.wait_until(lambda: page.text("stopped").startswith("Done"))
        assert "leader, follower told to stand" in page.text("stopped")
        page.wait_until(lambda: "leader stands · follower stands" in page.text("stopped"))
        page.wait_until(lambda: "Stopped by" in page.text("against"))
    said = [event.topic for event in iter(lambda: wire.inbox.take(0.3), None)]
    assert said.count(topics.STOP) >= 5
    assert topics.ARM not in said


def test_the_button_stops_and_a_robot_that_goes_on_is_told(lab: tuple[Server, Wire], chrome: Chrome) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address)
    with talking(wire, Motion(0.2, 0.0)):
        page.wait_until(page.is_live)
        page.click("stop")
        assert heard(wire, topics.STOP) == "stopped by hand on the live page"
        page.wait_until(lambda: page.text("stopped").startswith("NOT SURE"))
        assert "somebody still drives leader, follower" in page.text("stopped")
        page.wait_until(lambda: "follower MOVES" in page.text("stopped"))


def test_robots_are_armed_and_sent_to_the_other_side(lab: tuple[Server, Wire], chrome: Chrome) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address)
    with talking(wire):
        page.wait_until(lambda: page.is_live() and page.button("Arm follower").is_enabled())
        assert not page.button("Arm leader").is_enabled(), "it has no guard"
        for text, topic, word in (
            ("Arm follower", topics.ARM, "follower"),
            ("Arm all", topics.ARM, ""),
            ("Go to the right", "follower/side", "right"),
        ):
            page.button(text).click()
            assert heard(wire, topic) == word


def test_a_lab_that_falls_silent_is_not_shown_as_if_it_spoke(
    lab: tuple[Server, Wire], chrome: Chrome
) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address)
    with talking(wire):
        page.wait_until(lambda: page.is_live() and "tracking" in page.text("verdict"))
        page.wait_until(lambda: "lets it drive" in page.text("robots"))
        assert page.button("Arm follower").is_enabled()
        page.wait_until(lambda: page.script("return document.getElementById('verdict').className") == "")
    page.wait_until(lambda: page.script("return document.getElementById('verdict').className") == "bad")
    page.wait_until(lambda: "has said nothing for" in page.text("against"))
    page.wait_until(lambda: page.script("return document.querySelectorAll('#nodes .stale').length") == 3)
    page.wait_until(lambda: not page.button("Arm follower").is_enabled())
    page.wait_until(lambda: "lets it drive" not in page.text("robots"))
    assert page.script("return document.querySelectorAll('#robots td.soft').length") == 6
    assert "The motion capture does not see leader." in page.text("against")


def test_a_turn_rate_that_is_no_number_and_what_cannot_be_read_are_no_zeros(
    lab: tuple[Server, Wire], chrome: Chrome
) -> None:
    server, wire = lab
    page = WatchedPage(chrome, server.address)
    with talking(wire, Motion(0.2, math.nan)):
        page.wait_until(lambda: "+0.200, –" in page.text("robots"))
        assert "+0.200, +0" not in page.text("robots")
    wire.publish("follower/odom", b"junk")
    page.wait_until(lambda: "cannot be read" in page.text("robots"))


def test_a_server_that_goes_is_said_and_one_that_comes_back_is_found(chrome: Chrome) -> None:
    with router() as (endpoint, wire), talking(wire):
        with live_page(endpoint) as server:
            address, port = server.address, server.host.rpartition(":")[2]
            page = WatchedPage(chrome, address)
            page.wait_until(page.is_live)
            assert page.script("return bar.dataset.reach") == "yes"
            server.process.kill()
            page.wait_until(lambda: not page.is_live())
            page.wait_until(lambda: "all of this is" in page.text("link"))
            assert "the server is not reached" in page.text("alarm")
            assert "use the robot's switch" in page.text("how")
            assert (
                page.script("return getComputedStyle(document.querySelector('main')).filter")
                == "grayscale(1)"
            )
            page.click("stop")
            page.wait_until(lambda: page.text("stopped").startswith("NOT TOLD: the server is not reached"))
        with live_page(endpoint, "--live-port", port):
            page.wait_until(page.is_live)
            assert page.script("return bar.dataset.reach") == "yes"
            assert page.script("return alarm.hidden")
            page.press(Keys.SPACE)
            page.wait_until(lambda: page.text("stopped").startswith("Done"))


def test_without_the_token_of_the_address_nothing_is_shown(chrome: Chrome) -> None:
    with (
        router() as (endpoint, wire),
        talking(wire),
        live_page(endpoint, "--live-address", "0.0.0.0") as server,
    ):
        own = f"http://127.0.0.1:{server.host.rpartition(':')[2]}/"
        page = WatchedPage(chrome, own)
        page.wait_until(lambda: "open the whole address" in page.text("alarm"))
        page = WatchedPage(chrome, f"{own}#{'x' * 20}")
        page.wait_until(lambda: "of an earlier run" in page.text("alarm"))
        assert not page.is_live()
        page = WatchedPage(chrome, f"{own}#{server.token}")
        page.wait_until(page.is_live)
