"""Nodes, live: the wire and the clock on one side, their steps on the other."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from types import FrameType
from typing import Any, NamedTuple, Protocol

from hil.live.flood_watch import FloodWatch
from hil.live.listener_watch import ListenerWatch
from hil.live.sender_reports import SenderReports
from hil.live.service import Service
from hil.nodes.node import Outgoing
from hil.scenario.schema import Scenario
from hil.wire.events import TICK, Event
from hil.wire.pubsub import Inbox, Wire, joined
from hil.wire.senders import SenderWatch, single_topics
from hil.wire.session import Endpoints

_LONGEST_WAIT = 0.1
_LINGER = 0.05
_AFTERMATH = 0.5


class Worker(Protocol):
    """What a daemon does with what arrives."""

    subscribes: tuple[str, ...]
    thorough: bool
    """Whether, told to end, it still takes what is on its way."""

    def begin(self, now_ns: int) -> None:
        """Come up."""

    def due_ns(self) -> int:
        """When the worker wants to be woken if nothing arrives before."""

    def take(self, event: Event, now_ns: int) -> Iterable[Outgoing]:
        """Deal with an arrival or a tick while whoever publishes walks through what comes of it."""

    def end(self, now_ns: int) -> Iterable[Outgoing]:
        """Last words."""


class Presence(NamedTuple):
    """What the ROS graph calls a worker, and what makes the watch on who listens to it there.

    ``overhears``: topics that it hears though they are meant for others: it shows as no listener there.
    ``hear``: called with the diagnostics of what floods it.
    """

    name: str = ""
    make_watch: Callable[[Wire], ListenerWatch] | None = None
    overhears: frozenset[str] = frozenset()
    hear: Callable[[bytes], None] = lambda _: None


ANONYMOUS = Presence()


class Watches(NamedTuple):
    """Who may be listened to, and what there is to say, at a time, of what comes and of who listens.

    ``service``: hears each time that the daemon goes round.
    """

    service: Service
    senders: SenderWatch
    reports: Callable[[int], Iterable[Outgoing]]


class Ending:
    """Whether the process was asked to end: by a signal, by its duration, or by its parent going away.

    ``signal``: the number of the first one, 0 where it was none.
    """

    def __init__(self) -> None:
        self.asked, self.signal = False, 0
        self._wakers: list[Callable[[], None]] = []
        self._before: dict[signal.Signals, Any] = {}

    def ask(self) -> None:
        """Ask for the end."""
        self.asked = True
        for wake in self._wakers:
            wake()

    def notify(self, wake: Callable[[], None]) -> None:
        """Call ``wake`` when the end is asked for."""
        self._wakers.append(wake)

    def on_signals(self) -> None:
        """Let SIGINT, SIGTERM and SIGHUP (the terminal or the connection is gone) ask for the end."""

        def handle(number: int, _frame: FrameType | None) -> None:
            self.signal = self.signal or number
            self.ask()

        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            # Who was started with nohup is to outlive its terminal.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                self._before[number] = signal.signal(number, handle)

    def leave_signals(self) -> None:
        """Let signals do again what they did before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()

    def on_parent_gone(self) -> None:
        """Let the closing of standard input ask for the end: the parent holds its other side."""

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.ask()

        threading.Thread(target=watch, daemon=True).start()


def run_daemon(
    make_worker: Callable[[], Worker],
    scenario: Scenario,
    endpoints: Endpoints,
    ending: Ending,
    duration_s: float | None = None,
    on_ready: Callable[[], None] = lambda: None,
    presence: Presence = ANONYMOUS,
) -> int:
    """Run a worker on the wire until the end is asked for or ``duration_s`` is over.

    The worker is made once the wire is there; ``on_ready`` is called when it is subscribed. Events are taken
    one at a time in order of arrival; ``now`` is the host clock when one is taken. Topics lie where the
    scenario has them. Of what comes faster than any sane sender sends only so much is taken in, except by a
    thorough worker. Returns how many arrivals found the inbox full and were dropped.
    """
    service = Service()
    patience = service.patience_s(endpoints.describe())
    with joined(endpoints, scenario, presence.name, patience, lambda: ending.asked) as wire:
        ending.notify(wire.wake)
        worker = make_worker()
        worker.begin(time.time_ns())
        if worker.thorough:
            wire.inbox.intake = None
        for topic in worker.subscribes:
            # Who takes down everything is not who a message is meant for.
            wire.subscribe([topic], shown=not worker.thorough and topic not in presence.overhears)
        # What is loaded by now stays for good; walking it again would halt a live step for 100 ms and more.
        gc.freeze()
        senders = SenderWatch(single_topics(scenario))
        watch = _reports_on(wire, presence, senders)
        service.ready(time.monotonic())
        on_ready()
        try:
            _work(worker, wire, ending, duration_s, Watches(service, senders, watch))
        except Exception:
            # A controller that breaks down says stop all the same. The first error is the one to tell.
            with contextlib.suppress(Exception):
                _part(worker, wire)
            raise
        _part(worker, wire)
        return wire.inbox.dropped


def aftermath(inbox: Inbox, worker: Worker) -> Iterator[Iterable[Outgoing]]:
    """What a thorough worker says to arrivals until none comes for a moment.

    Where others go on sending, it ends after half a second.
    """
    until = time.monotonic() + _AFTERMATH
    while worker.thorough and time.monotonic() < until and (event := inbox.take(_LINGER)) is not None:
        yield worker.take(event, time.time_ns())


def _work(
    worker: Worker,
    wire: Wire,
    ending: Ending,
    duration_s: float | None,
    watches: Watches,
) -> None:
    until = None if duration_s is None else time.monotonic() + duration_s
    taken_ns = 0
    while not ending.asked and (until is None or time.monotonic() < until):
        wait = min((worker.due_ns() - time.time_ns()) * 1e-9, _LONGEST_WAIT)
        event = wire.inbox.take(wait)
        watches.service.goes_round(time.monotonic())
        now_ns = time.time_ns()
        if now_ns < taken_ns:
            # The clock was set back: what was due soon is now far away.
            _publish(wire, worker.take(TICK, now_ns))
        # Who takes down everything takes that of strangers too.
        if event is not None and (watches.senders.admits(event, time.monotonic_ns()) or worker.thorough):
            _publish(wire, worker.take(event, now_ns))
        # Also while arrivals are waiting: who is flooded must not fall silent.
        if (taken_ns := time.time_ns()) >= worker.due_ns():
            _publish(wire, worker.take(TICK, taken_ns))
        _publish(wire, watches.reports(taken_ns))
    watches.service.ends()
    for messages in aftermath(wire.inbox, worker):
        _publish(wire, messages)


def _reports_on(wire: Wire, presence: Presence, senders: SenderWatch) -> Callable[[int], Iterable[Outgoing]]:
    """What there is to say at a time of what comes and of who listens."""
    listeners = presence.make_watch(wire) if presence.make_watch else None
    intake = wire.inbox.intake
    second = SenderReports(presence.name, senders, wire.clients(), presence.hear)
    flood = FloodWatch(presence.name, intake, presence.hear) if intake is not None else None

    def reports(now_ns: int) -> Iterator[Outgoing]:
        if listeners is not None:
            yield from listeners.reports(now_ns)
        yield from second.reports(now_ns, time.monotonic_ns())
        if flood is not None:
            yield from flood.reports(now_ns, time.monotonic_ns())

    return reports


def _part(worker: Worker, wire: Wire) -> None:
    _publish(wire, worker.end(time.time_ns()))
    time.sleep(_LINGER)


def _publish(wire: Wire, messages: Iterable[Outgoing]) -> None:
    for message in messages:
        wire.publish(message.topic, message.payload)
