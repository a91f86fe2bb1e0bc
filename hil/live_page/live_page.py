"""The page's server between the lab and its browsers: it listens to the lab while somebody looks."""

from __future__ import annotations

import asyncio
import json
import secrets
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import zenoh

from hil import __version__
from hil.live_page.admission import Admission
from hil.live_page.browser_pace import BrowserPace
from hil.live_page.browser_words import Arm, Order, Stop
from hil.live_page.orbit import orbit_of
from hil.live_page.order_line import TOLD_TO_STOP, OrderLine
from hil.live_page.seen_frames import SeenFrames
from hil.live_page.shown_lab import ShownLab
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.key_layout import layout_of
from hil.wire.newest import Newest

FRAME_S = 0.05
"""From one frame for browsers to the next [s]."""

MOST_BROWSERS = 16
_MOST_FAILURES = 20
_REPORT_S = 0.5
_LINGER_S = 5.0
"""For so long [s] the lab is listened to after the last browser left: a page may be loaded anew."""

_TELL_S = 1.5
"""Within this time [s] an order is said, or else its browser is told that it may not have been."""

Send = Callable[[str], None]


class Viewer:
    """A browser that looks on: how it is sent something, at what pace, and at which follower it looks."""

    def __init__(self, send: Send, leave: Callable[[], None]) -> None:
        self.send, self.leave, self.pace = send, leave, BrowserPace()
        self.follower, self.reported_at = 0, -_REPORT_S


class LivePage:
    """All that the server knows. Called in its loop only. ``woken``: is set where :meth:`go_round` is due."""

    def __init__(
        self,
        session: zenoh.Session,
        scenario: Scenario,
        admission: Admission,
        allowed: frozenset[str] | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.admission = admission
        self._scenario, self._session, self._say = scenario, session, say
        self._lab = ShownLab(scenario)
        self._loop = asyncio.get_running_loop()
        self.woken = asyncio.Event()
        self._orders = OrderLine(session, scenario, allowed, self._told_from_thread)
        self._newest: Newest | None = None
        self._viewers: list[Viewer] = []
        self._frames = SeenFrames()
        self._number = secrets.token_hex(4)
        self._clock = time.monotonic
        self._failures: set[str] = set()
        self._empty_since, self._said = self._clock(), 0
        self._orbit: asyncio.Future[None] | None = None

    @property
    def is_full(self) -> bool:
        """Whether no more browsers are let in."""
        return len(self._viewers) >= MOST_BROWSERS

    @property
    def listens(self) -> bool:
        """Whether the lab is listened to."""
        return self._newest is not None

    def enter(self, viewer: Viewer) -> None:
        """A browser looks on from now on."""
        self._viewers.append(viewer)
        if self._newest is None:
            self._lab.forget()
            self._newest = Newest(self._session, layout_of(self._scenario), self._lab.kept)
            self.woken.set()
        if self._orbit is None:
            self._orbit = asyncio.ensure_future(self._find_orbit())
        about = {"server": self._number, "version": __version__, "may_stop": self._orders.may_stop}
        viewer.send(_json({"kind": "config", **self._lab.config(), **about}))

    def go(self, viewer: Viewer) -> None:
        """A browser looks on no longer."""
        if viewer in self._viewers:
            self._viewers.remove(viewer)
            self._empty_since = self._clock()

    def look_at(self, viewer: Viewer, follower: int) -> None:
        """A browser looks at a follower by its place, if there is such a one."""
        if follower < len(self._lab.followers):
            viewer.follower = follower

    async def order(self, wanted: Order) -> tuple[bool, str]:
        """Give an order: whether it was given, and in words what was."""
        if isinstance(wanted, Stop):
            self._frames.note_stop()
        if not self._orders.has_link:
            return False, "the lab's router is not reached: nothing was told; use the robot's switch"
        if isinstance(wanted, Stop):
            if not self._orders.may_stop:
                return False, "our keys do not let us stop anybody; use the robot's switch"
            given, text = await _said(self._orders.stop(), TOLD_TO_STOP)
            return given, text if given else f"{text}; use the robot's switch"
        if refusal := self._frames.refusal(wanted.frame, self._clock()):
            return False, refusal
        said, text = self._orders.order(wanted)
        return (False, text) if said is None else await _said(said, text)

    def go_round(self) -> None:
        """Take in what has come, and send it to the browsers that keep up; to be called every FRAME_S."""
        now = self._clock()
        for viewer in [each for each in self._viewers if each.pace.is_gone(now)]:
            self._dismiss(viewer)
        if self._newest is None:
            return
        # Also while nobody looks: else it would be taken for new when somebody does again.
        for event in self._newest.take():
            if event.topic == topics.STOP:
                self._frames.note_stop()
            self._lab.hear(event, now)
        if not self._viewers:
            if now - self._empty_since > _LINGER_S:
                self._newest.close()
                self._newest = None
            return
        number = self._frames.next(now)
        motions: dict[int, dict[str, Any]] = {}
        reports: dict[str, Any] | None = None
        for viewer in list(self._viewers):
            if not viewer.pace.may_send():
                continue
            if viewer.follower not in motions:
                motions[viewer.follower] = self._lab.motion(viewer.follower, now)
            frame = {"kind": "frame", "t": round(now, 4), "follower": viewer.follower}
            frame |= {"link": round(viewer.pace.link_s, 4), **motions[viewer.follower]}
            if now - viewer.reported_at >= _REPORT_S:
                viewer.reported_at = now
                reports = reports or self._reports(now)
                frame["reports"] = reports
            viewer.pace.send(number, now)
            viewer.send(_json({"n": number, **frame}))

    def close(self) -> None:
        """Say good-bye to all browsers, and listen no more."""
        for viewer in list(self._viewers):
            viewer.send(_json({"kind": "bye"}))
            self._dismiss(viewer)
        if self._newest is not None:
            self._newest.close()
            self._newest = None
        self._orders.close()

    def say_failed(self, error: Exception) -> None:
        """Tell the terminal of what kept a frame from being made, each thing once."""
        line = f"what the lab said cannot be shown: {error!r}; please report this"
        if line not in self._failures and len(self._failures) < _MOST_FAILURES:
            self._failures.add(line)
            self._say(line)

    def say_refused(self) -> None:
        """Tell the terminal of requests that were refused since it was told last."""
        refused = self.admission.refused
        if (count := refused.total()) > self._said:
            self._said = count
            causes = ", ".join(f"{number} by {cause}" for cause, number in sorted(refused.items()))
            self._say(f"refused {causes}")

    def _reports(self, now: float) -> dict[str, Any]:
        return {
            **self._lab.reports(now),
            "link": self._orders.has_link,
            "browsers": len(self._viewers),
            "refused": dict(self.admission.refused),
        }

    def _dismiss(self, viewer: Viewer) -> None:
        """Hang up; it counts no longer, whenever its connection ends."""
        self.go(viewer)
        viewer.leave()

    def _told_from_thread(self, state: str, text: str) -> None:
        self._loop.call_soon_threadsafe(self._tell, state, text)

    def _tell(self, state: str, text: str) -> None:
        """Tell all browsers of a stop, whoever asked for it."""
        for viewer in list(self._viewers):
            viewer.send(_json({"kind": "stop", "state": state, "text": text}))

    async def _find_orbit(self) -> None:
        self._lab.orbit = await asyncio.to_thread(orbit_of, self._scenario)


async def _said(telling: Future[None], text: str) -> tuple[bool, str]:
    """Whether an order was said in time, and in words what was, or why it was not."""
    said = asyncio.wrap_future(telling)
    # A failure that comes too late to be told is no news.
    said.add_done_callback(lambda late: late.cancelled() or late.exception())
    await asyncio.wait({said}, timeout=_TELL_S)
    if not said.done():
        taken_back = telling.cancel()
        return False, "not told in time, and taken back" if taken_back else "not known whether it was told"
    if said.cancelled():
        return False, "not told: a stop came first"
    error = said.exception()
    return (True, text) if error is None else (False, f"not told: {error}")


def answer(order: Order, given: bool, text: str) -> str:
    """What a browser is told of its own order."""
    words = {"kind": "answer", "order": "arm" if isinstance(order, Arm) else order.__struct_config__.tag}
    return _json({**words, "given": given, "text": text})


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
