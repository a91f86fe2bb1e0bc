"""The way from the page to the lab: stop as the command of that name says it, arming, side changes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import zenoh

from hil.live.stopping import REPEAT_S, TIMES, Stopped, may_stop, say_stop, stop_all
from hil.live_page.browser_words import Arm, ChangeSide
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.key_layout import layout_of
from hil.wire.lab_robots import robots_of
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.topics import topics_of, urgent_topics

REASON = "stopped by hand on the live page"


class OrderLine:
    """Gives orders from threads of its own, as Zenoh may keep one waiting that gives them.

    ``told``: called in such a thread when a stop was said, with None, and when it is known what came of it.
    """

    def __init__(
        self,
        session: zenoh.Session,
        scenario: Scenario,
        allowed: frozenset[str] | None,
        told: Callable[[Stopped | None], None],
    ) -> None:
        self._session, self._scenario, self._allowed, self._told = session, scenario, allowed, told
        self._names = {robot.name for robot in robots_of(scenario)}
        self._threads = ThreadPoolExecutor(4, "order")
        self._watching, self._repeating = threading.Lock(), threading.Lock()
        self._wire = self._new_wire()

    @property
    def may_stop(self) -> bool:
        """Whether our keys let us give orders."""
        return may_stop(self._wire)

    @property
    def has_link(self) -> bool:
        """Whether there is somebody on the wire to give orders to."""
        return bool(self._session.info.links())

    def stop(self) -> Future[None]:
        """Stop everybody; done when that was said for the first time, and what comes of it is told."""
        said: Future[None] = Future()
        self._threads.submit(self._stop, said)
        return said

    def order(self, wanted: Arm | ChangeSide) -> str:
        """Give another order; in words what was said, or why nothing was."""
        if isinstance(wanted, Arm):
            if wanted.robot and wanted.robot not in self._names:
                return f"there is no robot {wanted.robot!r}"
            topic, word, text = topics.ARM, wanted.robot, f"told {wanted.robot or 'all'} to be armed"
        else:
            topic, word = topics_of(self._scenario).side, wanted.side
            text = f"told the follower to go to the {word}"
        if not self._wire.may_publish(topic):
            return "our keys do not let us give this order"
        self._threads.submit(self._wire.publish, topic, encode(String(data=word)))
        return text

    def close(self) -> None:
        """Let orders be given to their end, and take back all declarations."""
        self._threads.shutdown()
        self._wire.close()

    def _stop(self, said: Future[None]) -> None:
        try:
            say_stop(self._wire, self._scenario, REASON)
        except BaseException as error:
            said.set_exception(error)
            raise
        said.set_result(None)
        self._told(None)
        if self._watching.acquire(blocking=False):
            try:
                self._watch()
            finally:
                self._watching.release()
        elif self._repeating.acquire(blocking=False):
            # Whoever presses again while one listens what came of the last is heard as well.
            try:
                for _ in range(TIMES - 1):
                    time.sleep(REPEAT_S)
                    say_stop(self._wire, self._scenario, REASON)
            finally:
                self._repeating.release()

    def _watch(self) -> None:
        """Stop everybody as ``abreast stop`` does, and tell what came of it."""
        wire = self._new_wire()
        try:
            self._told(stop_all(wire, self._scenario, REASON))
        finally:
            wire.close()

    def _new_wire(self) -> Wire:
        layout = layout_of(self._scenario)
        return Wire(self._session, urgent_topics(self._scenario), layout, "live", self._allowed)
