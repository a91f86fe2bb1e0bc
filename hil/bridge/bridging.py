"""A bridge as a daemon: whoever brings messages on one side, the wire on the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Protocol

from hil.live.daemon import Ending
from hil.live.service import Service
from hil.nodes.node import Outgoing
from hil.scenario.schema import Scenario
from hil.wire.pubsub import Wire, joined
from hil.wire.session import Endpoints

_LONGEST_WAIT = 0.05


class Bridge(Protocol):
    """What brings messages from elsewhere."""

    def wait(self, timeout: float) -> None:
        """Return when something has come, at the latest after ``timeout`` [s]."""

    def take(self, now_ns: int) -> Iterable[Outgoing]:
        """What has come, and what is due besides, to be published at once."""

    def end(self, now_ns: int) -> Iterable[Outgoing]:
        """Last words."""

    def close(self) -> None:
        """Let go of all that is held."""


def run_bridge(
    make_bridge: Callable[[Wire], Bridge],
    scenario: Scenario,
    endpoints: Endpoints,
    ending: Ending,
    duration_s: float | None = None,
    on_ready: Callable[[], None] = lambda: None,
) -> None:
    """Publish what a bridge brings until the end is asked for or ``duration_s`` is over.

    The bridge is made once the wire is there, and is given it. Topics lie where the scenario has them.
    """
    service = Service()
    patience = service.patience_s(endpoints.describe())
    with joined(endpoints, scenario, "bridge", patience, lambda: ending.asked) as wire:
        bridge = make_bridge(wire)
        try:
            service.ready(time.monotonic())
            on_ready()
            until = None if duration_s is None else time.monotonic() + duration_s
            while not ending.asked and (until is None or time.monotonic() < until):
                bridge.wait(_LONGEST_WAIT)
                service.goes_round(time.monotonic())
                _publish(wire, bridge.take(time.time_ns()))
            service.ends()
            _publish(wire, bridge.end(time.time_ns()))
        finally:
            bridge.close()


def _publish(wire: Wire, messages: Iterable[Outgoing]) -> None:
    for message in messages:
        wire.publish(message.topic, message.payload)
