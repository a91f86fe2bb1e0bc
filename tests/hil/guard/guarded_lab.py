"""A lab for tests of the guard: a router, commanders, and a driver that keeps its last command."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zenoh

from formation.pose import STANDSTILL, Motion
from hil.live.guards_heard import GuardsHeard
from hil.wire import topics
from hil.wire.drive_message import read_drive
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session
from tests.routers import router

PATIENCE = 60.0
WANTED, TOLD = "follower/cmd_vel_wanted", "follower/cmd_vel"
COMMANDER = Path(__file__).parent / "commander.py"
FORWARD = Motion(0.1, 0.3)
SOON = 0.3
"""What a robot that nobody drives is told, or was told, within this time [s] by the requirement."""


class Lab:
    """A router, its robot's driver, and processes around it."""

    def __init__(self, endpoint: str, wire: Wire, held: ExitStack) -> None:
        self.endpoint, self.wire, self._held = endpoint, wire, held
        self.told, self.told_s, self.last_driven_s = STANDSTILL, 0.0, 0.0
        self.guards = GuardsHeard()
        wire.subscribe([TOLD, topics.DIAGNOSTICS])

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """A process that ends with the test."""
        process = subprocess.Popen([sys.executable, *arguments], stderr=subprocess.PIPE, text=True)
        self._held.callback(_end, process)
        return process

    def guard(self) -> subprocess.Popen[str]:
        """A guard that is ready."""
        given = ("guard", "turtlebot3", "--robot", "follower", "--connect", self.endpoint)
        process = self.start("-m", "hil", *given)
        self.until(lambda: "follower" in self.guards.held)
        return process

    def commander(self) -> subprocess.Popen[str]:
        """Somebody who drives."""
        return self.start(str(COMMANDER), self.endpoint, str(FORWARD.v), str(FORWARD.u))

    def listen(self, seconds: float) -> None:
        """Be the driver for a while."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            event = self.wire.inbox.take(left)
            if event is not None and event.topic == TOLD:
                self.told, self.told_s = read_drive(event.payload, stamped=True), time.monotonic()
                if self.told != STANDSTILL:
                    self.last_driven_s = self.told_s
            elif event is not None and event.topic:
                self.guards.hear(event.payload)

    def until(self, is_so: Callable[[], bool]) -> None:
        """Be the driver until something is so."""
        until = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < until, (self.told, self.guards.held)
            self.listen(0.02)

    def drives(self) -> bool:
        return self.told == FORWARD

    def stands_soon(self) -> None:
        """The driver is told to stand soon from now on."""
        self.stands_after(time.monotonic())

    def stands_after(self, cause_s: float) -> None:
        """The driver was told to stand soon after a moment, and is told nothing else since."""
        self.until(lambda: self.told == STANDSTILL)
        self.listen(1.5)
        assert self.told == STANDSTILL
        assert self.last_driven_s - cause_s <= SOON

    def arm(self) -> None:
        self.wire.publish(topics.ARM, encode(String(data="follower")))


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGCONT)
    process.kill()
    process.communicate()


@contextmanager
def guarded_lab() -> Iterator[Lab]:
    with router() as (endpoint, wire), ExitStack() as held:
        yield Lab(endpoint, wire, held)


@contextmanager
def router_client(endpoint: str) -> Iterator[zenoh.Session]:
    """A session of somebody who says nothing of himself."""
    session = open_session(Endpoints(connect=endpoint))
    try:
        yield session
    finally:
        close_session(session)
