"""Everybody is stopped by hand: controllers by a stop, robots by a command to stand, said again and again."""

from __future__ import annotations

import time
from dataclasses import dataclass

from hil.live.lab_state import LabState, hear_for
from hil.nodes.link_nodes import leader_standstill, standstill
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire

TIMES, REPEAT_S = 5, 0.1
"""How often a stop is said, and how long after each other [s]."""

_PATIENCE_S = 2.0
_LOOK_S = 0.3


@dataclass(frozen=True, slots=True)
class Stopped:
    """What came of a stop.

    ``robots``: all that were told to stand; of these ``driven``: who was told otherwise by somebody to the
    last, and ``unheard``: of whom nothing was heard.
    """

    reason: str
    robots: tuple[str, ...]
    driven: tuple[str, ...]
    unheard: tuple[str, ...]

    @property
    def done(self) -> bool:
        """Whether all robots were told to stand, were heard of, and nobody told one otherwise."""
        return not (self.driven or self.unheard)

    def line(self) -> str:
        """The same in words, with what to do."""
        if self.done:
            return f"{', '.join(self.robots)} told to stand ({self.reason})"
        driven = [f"somebody still drives {', '.join(self.driven)}"] if self.driven else []
        unheard = [f"nothing was heard of {', '.join(self.unheard)} on this wire"] if self.unheard else []
        return "; ".join([*driven, *unheard, "use the robot's switch"])


def may_stop(wire: Wire) -> bool:
    """Whether our keys let us stop everybody."""
    return wire.may_publish(topics.STOP)


def say_stop(wire: Wire, scenario: Scenario, reason: str) -> None:
    """Say once that all are to stop, and to every robot that it is to stand.

    What cannot be said keeps nothing else from being said; raises the first of such failures at the end.
    """
    failures: list[Exception] = []

    def publish(topic: str, payload: bytes) -> None:
        try:
            wire.publish(topic, payload)
        except Exception as error:
            failures.append(error)

    publish(topics.STOP, encode(String(data=reason)))
    now_ns = time.time_ns()
    links = links_of(scenario)
    for still in (leader_standstill(scenario, now_ns), *(standstill(link, now_ns) for link in links)):
        # Behind a guard it is the guard that lets a robot stand, by the stop.
        if wire.may_publish(still.topic):
            publish(still.topic, still.payload)
    if failures:
        raise failures[0]


def stop_all(wire: Wire, scenario: Scenario, reason: str) -> Stopped:
    """Stop everybody, and listen whether that is heeded: takes half a second, up to 2.5 s where it is not.

    The wire has nothing else in its inbox: nobody else subscribes by it. Raises what kept a stop from being
    said where it could not be said once in all tries.
    """
    state, clock = LabState(scenario), time.monotonic
    # What we say ourselves comes back on any wire, also on one without robots.
    wire.subscribe(state.robot_topics, shown=False, ours=False)
    failures: list[Exception] = []
    for _ in range(TIMES):
        try:
            say_stop(wire, scenario, reason)
        except Exception as error:
            failures.append(error)
        hear_for(state, wire.inbox.take, clock, clock() + REPEAT_S)
    if len(failures) == TIMES:
        raise failures[0]
    until = clock() + _PATIENCE_S
    while ((driven := state.driven(clock())) or state.unheard()) and clock() < until:
        hear_for(state, wire.inbox.take, clock, clock() + _LOOK_S)
    return Stopped(reason, tuple(state.robots.values()), tuple(driven), tuple(state.unheard()))
