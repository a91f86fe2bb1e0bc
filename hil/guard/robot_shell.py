"""A guard at work: what comes by Zenoh goes to it, and what it decides to the driver, by two threads.

One thread looks at the clocks and decides; it waits for nobody. Another one tells the driver, always the
newest, and may be held up by whatever carries it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

import zenoh

from formation.pose import STANDSTILL, Motion
from hil.guard.diagnostics_bytes import diagnostics_bytes
from hil.guard.driver import Driver
from hil.guard.order import GuardOrder
from hil.guard.reading import read_driven, read_wanted, read_word
from hil.guard.report import node_of, problem_of, values_of
from hil.guard.robot_guard import LOOK_S, Now, RobotGuard, Told
from hil.wire.body_walk import spots_in
from hil.wire.clock_query import ClockQuery
from hil.wire.outlet import Outlet, gid_of, origin_of, sender_of
from hil.wire.undeclare import undeclare

STUCK_S = 0.5
"""A driver that takes a command for longer than this [s] is stuck."""

_PARTING = 3
_LARGEST = 1 << 16


class RobotShell:
    """Threads and subscriptions of a guard on a session."""

    def __init__(self, session: zenoh.Session, order: GuardOrder, driver: Driver) -> None:
        self._session, self._order, self._driver = session, order, driver
        self.guard = RobotGuard(order.rules)
        self._changed = threading.Condition()
        self._heard = self._ended = False
        self._next: Told | None = None
        self._to_say = threading.Condition()
        self._busy_since_s: float | None = None
        self.failures = 0
        reports = session.declare_publisher(order.diagnostics, encoding=zenoh.Encoding.APPLICATION_CDR)
        gid = gid_of(f"{session.zid()}/{order.diagnostics}") if order.attached else b""
        self._reports = Outlet(reports, gid)
        self._clock = ClockQuery(session)
        hearing: dict[str, Callable[[zenoh.Sample], None]] = {
            order.wanted: self._on_wanted,
            order.stop: self._on_stop,
            order.arm: self._on_arm,
            order.frames: self._on_frame,
        }
        self._subscribers = [
            session.declare_subscriber(key, zenoh.handlers.Callback(hear, indirect=False))
            for key, hear in hearing.items()
        ]
        others = zenoh.handlers.Callback(self._on_driven, indirect=False)
        self._subscribers.append(
            session.declare_subscriber(order.overheard, others, allowed_origin=zenoh.Locality.REMOTE)
        )
        shown = order.tokens_of(str(session.zid()))
        self._tokens = [session.liveliness().declare_token(token) for token in shown]
        works = self._look, self._speak
        self._threads = [threading.Thread(target=work, daemon=True) for work in works]
        for thread in self._threads:
            thread.start()

    def report(self) -> str:
        """Publish how the guard is, and ask its sender for the time; what is wrong, empty for nothing."""
        now = _now()
        with self._changed:
            sender = self.guard.sender
            self.guard.clock_s = self._clock.ahead_s(sender.session) if sender is not None else None
            problem, values = problem_of(self.guard, now), values_of(self.guard, now)
        if not self.decides():
            problem = "the guard has broken down, and makes its robot stand"
        elif self.is_stuck():
            problem = f"the driver has taken a command for more than {STUCK_S:g} s; see what holds it up"
        values["driver_failures"] = self.failures
        if self._clock.heard and sender is not None:
            values["clock_ms"] = f"{1e3 * self._clock.seen_s:.1f}"
        report = diagnostics_bytes(node_of(self._order.robot), now.host_ns, problem, values)
        with contextlib.suppress(zenoh.ZError):
            # A session that fails costs a report, never the guard.
            self._reports.put(report)
            if sender is not None:
                self._clock.ask(sender.session)
        return problem

    def decides(self) -> bool:
        """Whether both threads are alive: without them the driver would keep its last command."""
        return all(thread.is_alive() for thread in self._threads)

    def is_stuck(self) -> bool:
        """Whether the driver does not take what it is told."""
        since_s = self._busy_since_s
        return since_s is not None and time.monotonic() - since_s > STUCK_S

    def close(self) -> None:
        """Tell the driver to stand, and end."""
        with self._changed:
            self.guard.stop("the guard ended", "the guard")
            self._ended = True
            self._changed.notify()
        with self._to_say:
            self._to_say.notify()
        for thread in self._threads:
            thread.join(STUCK_S)
        if not self.is_stuck():
            for _ in range(_PARTING):
                self._tell(STANDSTILL)
        self.report()
        undeclare(*self._tokens)
        undeclare(*self._subscribers)
        self._driver.close()

    def _on_wanted(self, sample: zenoh.Sample) -> None:
        wanted, origin = read_wanted(_small(sample)), origin_of(sample)
        with self._changed:
            self.guard.hear(wanted, origin, _now())
            self._heard = True
            self._changed.notify()

    def _on_stop(self, sample: zenoh.Sample) -> None:
        word = read_word(_small(sample))
        with self._changed:
            reason = "for a reason that cannot be read" if word is None else word
            self.guard.stop(reason, sender_of(origin_of(sample)))
            self._heard = True
            self._changed.notify()

    def _on_arm(self, sample: zenoh.Sample) -> None:
        if read_word(_small(sample)) in ("", self._order.robot):
            with self._changed:
                self.guard.arm(_now())

    def _on_frame(self, sample: zenoh.Sample) -> None:
        if not self.guard.rules.is_fenced:
            return
        spots = spots_in(_small(sample))
        with self._changed:
            self.guard.see(spots)

    def _on_driven(self, sample: zenoh.Sample) -> None:
        motion = read_driven(_small(sample), self._order.stamped)
        with self._changed:
            self.guard.overhear(motion, sender_of(origin_of(sample)))
            self._heard = True
            self._changed.notify()

    def _look(self) -> None:
        while True:
            with self._changed:
                if not self._heard and not self._ended:
                    self._changed.wait(LOOK_S)
                if self._ended:
                    return
                heard, self._heard = self._heard, False
                told = self.guard.say(_now(), heard=heard)
            if told is not None:
                with self._to_say:
                    self._next = told
                    self._to_say.notify()

    def _speak(self) -> None:
        while True:
            with self._to_say:
                while self._next is None and not self._ended:
                    self._to_say.wait(LOOK_S)
                told, self._next = self._next, None
            if self._ended:
                return
            if told is not None:
                self._tell(told.motion)

    def _tell(self, motion: Motion) -> None:
        self._busy_since_s = time.monotonic()
        try:
            self._driver.tell(motion, time.time_ns())
        except Exception:
            # Whatever it is: the next one may get through, and is only milliseconds away.
            self.failures += 1
        self._busy_since_s = None


def _small(sample: zenoh.Sample) -> bytes:
    """A payload, empty for one that no message for a guard fills."""
    return sample.payload.to_bytes() if len(sample.payload) <= _LARGEST else b""


def _now() -> Now:
    return Now(time.time_ns(), time.monotonic())
