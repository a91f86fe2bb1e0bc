"""The way from the page to the lab: stop as the command of that name says it, arming, side changes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import zenoh

from hil.live.stopping import REPEAT_S, TIMES, may_stop, say_stop, stop_all
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
TOLD_TO_STOP = "everybody is told to stop"

Told = Callable[[str, str], None]


class OrderLine:
    """Gives orders from threads of its own, as Zenoh may keep one waiting that gives them.

    Stops have threads that nothing else can fill; any other order waits for the one before it.
    ``told``: called in such a thread with the state of a stop and its words: ``told`` when it was said, and
    ``done`` or ``failed`` when it is known what came of it, or that this cannot be known.
    """

    def __init__(
        self, session: zenoh.Session, scenario: Scenario, allowed: frozenset[str] | None, told: Told
    ) -> None:
        self._session, self._scenario, self._allowed, self._told = session, scenario, allowed, told
        self._names = {robot.name for robot in robots_of(scenario)}
        self._stops, self._others = ThreadPoolExecutor(4, "stop"), ThreadPoolExecutor(1, "order")
        self._waiting: set[Future[None]] = set()
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
        """Stop everybody; done when that was said for the first time, and what comes of it is told.

        Orders that wait are dropped.
        """
        for each in list(self._waiting):
            each.cancel()
        said: Future[None] = Future()
        # From here on nobody takes it back.
        said.set_running_or_notify_cancel()
        self._stops.submit(self._stop, said)
        return said

    def order(self, wanted: Arm | ChangeSide) -> tuple[Future[None] | None, str]:
        """Give another order: what is done when it was said, and its words; None, and why it is not given."""
        if isinstance(wanted, Arm):
            if wanted.robot and wanted.robot not in self._names:
                return None, f"there is no robot {wanted.robot!r}"
            topic, word, text = topics.ARM, wanted.robot, f"told {wanted.robot or 'all'} to be armed"
        else:
            topic, word = topics_of(self._scenario).side, wanted.side
            text = f"told the follower to go to the {word}"
        if not self._wire.may_publish(topic):
            return None, "our keys do not let us give this order"
        said = self._others.submit(self._wire.publish, topic, encode(String(data=word)))
        self._waiting.add(said)
        said.add_done_callback(self._waiting.discard)
        return said, text

    def close(self) -> None:
        """Let stops be given to their end, and take back all declarations."""
        self._others.shutdown(cancel_futures=True)
        self._stops.shutdown()
        self._wire.close()

    def _stop(self, said: Future[None]) -> None:
        try:
            say_stop(self._wire, self._scenario, REASON)
        except BaseException as error:
            # It is said again below: what failed once may not fail twice.
            said.set_exception(error)
        else:
            said.set_result(None)
            self._told("told", TOLD_TO_STOP)
        if self._watching.acquire(blocking=False):
            try:
                self._watch()
            finally:
                self._watching.release()
        elif self._repeating.acquire(blocking=False):
            # Whoever presses again while one listens what came of the last is heard as well.
            try:
                self._repeat()
            finally:
                self._repeating.release()

    def _repeat(self) -> None:
        for _ in range(TIMES - 1):
            time.sleep(REPEAT_S)
            try:
                say_stop(self._wire, self._scenario, REASON)
            except Exception as error:
                self._told("failed", f"a stop could not be said ({error}); use the robot's switch")

    def _watch(self) -> None:
        """Stop everybody as ``abreast stop`` does, and tell what came of it."""
        wire: Wire | None = None
        try:
            wire = self._new_wire()
            stopped = stop_all(wire, self._scenario, REASON)
        except Exception as error:
            self._told("failed", f"not known what came of it ({error}); use the robot's switch")
        else:
            # The page itself tells of each robot whether it stands, for as long as it is looked at.
            self._told(*(("done", stopped.told) if stopped.done else ("failed", stopped.line())))
        finally:
            if wire is not None:
                wire.close()

    def _new_wire(self) -> Wire:
        layout = layout_of(self._scenario)
        return Wire(self._session, urgent_topics(self._scenario), layout, "live", self._allowed)
