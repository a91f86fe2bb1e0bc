"""From a stop on the live page to what a robot's driver is told being zero, also under a flood.

``python -m benchmarks.live_stop [--tries 50] [--flood 10000] [--browser]``: a router, a guard on the follower
as on a robot, a controller that drives it at 120 Hz, and the page's server, each a process; the page is
looked at. With ``--flood`` somebody sends that many messages a second besides. The stop is sent by a
websocket, with ``--browser`` by the page's own button in Chromium. One clock measures all, the host's.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import ExitStack

import numpy as np
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.nodes.node import diagnostics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.key_layout import OURS
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.newest import Newest
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

_PYTHON = (sys.executable, "-m")
_PERIOD_S, _PATIENCE_S = 1.0 / 120.0, 60.0


class Driver:
    """The robot's end: what its driver was told last, and since when it has been told to stand."""

    def __init__(self, wire: Wire) -> None:
        self.drives, self.stood_at = False, math.inf
        self._wire = wire
        wire.subscribe(["follower/cmd_vel"])

    def listen(self, over: threading.Event) -> None:
        while not over.is_set():
            event = self._wire.inbox.take(0.1)
            if event is None:
                continue
            stands = read_drive(event.payload, stamped=True) == STANDSTILL
            if stands and self.drives:
                self.stood_at = time.time()
            elif not stands:
                self.stood_at = math.inf
            self.drives = not stands


def control(wire: Wire, over: threading.Event) -> None:
    """Be the controller, whom no stop reaches: the guard alone lets the robot stand."""
    while not over.wait(_PERIOD_S):
        now_ns = time.time_ns()
        wanted = drive_message(Motion(0.1, 0.0), now_ns, "", stamped=True)
        wire.publish("follower/cmd_vel_wanted", encode(wanted))
        wheels = odometry_message(now_ns, "follower", Pose(0.0, 0.0, 0.0), STANDSTILL)
        wire.publish("follower/odom", encode(wheels))


def flood(endpoint: str, rate_hz: float) -> None:
    """Send so many messages a second, half of them estimates and half reports, until killed."""
    wire = Wire(open_session(Endpoints(connect=endpoint), patience=_PATIENCE_S))
    report = encode(diagnostics("flooder", 5, "too much", {f"refused.{k}": k for k in range(10)}))
    begun, sent = time.monotonic(), 0
    while True:
        due = int((time.monotonic() - begun) * rate_hz)
        for number in range(sent, due):
            if number % 2:
                wire.publish("follower/leader_estimate", b"\0" * 600)
            else:
                wire.publish("diagnostics", report)
        sent = due
        time.sleep(0.001)


class Trial:
    """The robot is driven again, and told to stand."""

    def __init__(self, driver: Driver, wire: Wire) -> None:
        self._driver, self._wire = driver, wire

    def ready(self) -> None:
        """Wait until the robot drives, by arming its guard."""
        time.sleep(1.0)
        while not self._driver.drives:
            self._wire.publish("arm", encode(String(data="follower")))
            time.sleep(0.3)
        self._driver.stood_at = math.inf

    def stood(self) -> float:
        """When the driver was told to stand for good [s since 1970]."""
        until = time.monotonic() + _PATIENCE_S
        while not math.isfinite(at := self._driver.stood_at):
            if time.monotonic() > until:
                raise SystemExit("waited in vain: is the machine too busy?")
            time.sleep(0.002)
        time.sleep(0.2)
        return at if self._driver.stood_at == at else math.inf


async def stops_by_websocket(host: str, tries: int, trial: Trial) -> list[float]:
    """Seconds from each stop to the standstill; frames are acknowledged meanwhile."""
    with urllib.request.urlopen(f"http://{host}/token") as answer:
        token = answer.read().decode()
    socket = await websocket_connect(HTTPRequest(f"ws://{host}/lab", headers={"Origin": f"http://{host}"}))
    await socket.write_message(json.dumps({"say": "hello", "token": token}))

    async def look() -> None:
        while (text := await socket.read_message()) is not None:
            said = json.loads(text)
            if said["kind"] == "frame":
                await socket.write_message(json.dumps({"say": "seen", "frame": said["n"]}))

    looking = asyncio.ensure_future(look())
    took = []
    for _ in range(tries):
        await asyncio.to_thread(trial.ready)
        begun = time.time()
        await socket.write_message(json.dumps({"say": "stop"}))
        took.append(await asyncio.to_thread(trial.stood) - begun)
    socket.close()
    await looking
    return took


def stops_by_button(address: str, tries: int, trial: Trial) -> list[float]:
    """The same by the button: the page notes when it was pressed."""
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    options = ChromeOptions()
    for argument in ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    chrome = Chrome(options, Service("/usr/bin/chromedriver"))
    try:
        chrome.get(address)
        note = "window.pressed = performance.timeOrigin + performance.now();"
        chrome.execute_script(f"addEventListener('pointerdown', () => {{ {note} }}, true)")
        took = []
        for _ in range(tries):
            trial.ready()
            chrome.find_element("id", "stop").click()
            at = trial.stood()
            took.append(at - chrome.execute_script("return window.pressed") / 1000)
        return took
    finally:
        chrome.quit()


def main(tries: int, rate_hz: float, browser: bool) -> None:
    over = threading.Event()
    with ExitStack() as held:
        endpoint = held.enter_context(reserved_endpoint())
        held.callback(close_session, open_session(Endpoints(listen=endpoint)))

        def begun(*words: str, **how: int) -> subprocess.Popen[str]:
            process = subprocess.Popen([*_PYTHON, *words], text=True, **how)  # type: ignore[call-overload]
            held.callback(process.wait)
            held.callback(process.kill)
            return process  # type: ignore[no-any-return]

        page = begun("hil", "live", "--connect", endpoint, stderr=subprocess.PIPE)
        guard = ("guard", "turtlebot3", "--robot", "follower")
        begun("hil", *guard, "--connect", endpoint, stderr=subprocess.DEVNULL)
        if rate_hz:
            begun("benchmarks.live_stop", "--flood-at", endpoint, "--flood", str(rate_hz))
        assert page.stderr is not None
        address = page.stderr.readline().split()[-1]
        host = address.split("/")[2]
        sessions = [open_session(Endpoints(connect=endpoint)) for _ in range(2)]
        driving, robot = map(Wire, sessions)
        driver = Driver(robot)
        threads = [
            threading.Thread(target=control, args=(driving, over)),
            threading.Thread(target=driver.listen, args=(over,)),
        ]
        for thread in threads:
            thread.start()

        numbers = Newest(sessions[1], OURS, {"follower/leader_estimate": 1})
        trial, since = Trial(driver, robot), time.monotonic()
        try:
            if browser:
                took = stops_by_button(address, tries, trial)
            else:
                took = asyncio.run(stops_by_websocket(host, tries, trial))
            flooded = [event.origin.number for event in numbers.take() if event.origin]
            came_hz = 2 * flooded[0] / (time.monotonic() - since) if flooded else 0.0
        finally:
            numbers.close()
            over.set()
            for thread in threads:
                thread.join()
            for session in sessions:
                close_session(session)
    ms = 1e3 * np.array(took)
    how = "button" if browser else "websocket"
    print(
        f"stop by {how}, {came_hz:.0f} messages/s besides: {tries} tries, "
        f"p50 {np.median(ms):.1f} ms, p99 {np.percentile(ms, 99):.1f} ms, longest {ms.max():.1f} ms"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, default=50)
    parser.add_argument("--flood", type=float, default=0.0)
    parser.add_argument("--flood-at", default="")
    parser.add_argument("--browser", action="store_true")
    given = parser.parse_args()
    if given.flood_at:
        flood(given.flood_at, given.flood)
    else:
        main(given.tries, given.flood, given.browser)
