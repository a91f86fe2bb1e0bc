"""Everybody is stopped by hand: controllers by a stop, robots by a command to stand, said again and again."""

from __future__ import annotations

import time
from dataclasses import dataclass

from hil.live.coming_to_rest import ComingToRest, Rest, rest_words
from hil.live.lab_state import LabState, hear_for
from hil.nodes.link_nodes import leader_standstill, standstill
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.lab_robots import robots_of
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire

TIMES, REPEAT_S = 5, 0.1
"""How often a stop is said, and how long after each other [s]."""

_PATIENCE_S = 2.0
_LOOK_S = 0.3
_REST_S = 1.5
"""For odometry to say that a robot stands that was told to [s]."""
_REST_LOOK_S = 0.05


@dataclass(frozen=True, slots=True)
class Stopped:
    """What came of a stop.

    ``robots``: all that were told to stand; of these ``driven``: who was told otherwise by somebody to the
    last, and ``unheard``: of whom nothing was heard. ``rest``: what the odometry of the others says;
    ``nodes``: who said that it stopped where a robot is unheard.
    """

    reason: str
    robots: tuple[str, ...]
    driven: tuple[str, ...] = ()
    unheard: tuple[str, ...] = ()
    rest: tuple[Rest, ...] = ()
    nodes: tuple[str, ...] = ()

    @property
    def done(self) -> bool:
        """Whether all were told to stand and heard of, nobody told one otherwise, and none moves on."""
        return not (self.driven or self.unheard or any(each.moves for each in self.rest))

    @property
    def told(self) -> str:
        """Who was told, and why, in words."""
        return f"{', '.join(self.robots)} told to stand ({self.reason})"

    def line(self) -> str:
        """All of it in words, with what to do."""
        rest = rest_words(self.rest)
        if self.done:
            return f"{self.told}: {rest}" if rest else self.told
        driven = [f"somebody still drives {', '.join(self.driven)}"] if self.driven else []
        unheard = [f"nothing was heard of {', '.join(self.unheard)} on this wire"] if self.unheard else []
        nodes = [f"{', '.join(self.nodes)} did stop"] if self.nodes else []
        return "; ".join([*driven, *unheard, *nodes, *([rest] if rest else []), "use the robot's switch"])


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
    """Stop everybody, and listen whether that is heeded, and whether the robots stand.

    Takes half a second where they do, up to 2.5 s where that is not heard. The wire has nothing else in its
    inbox: nobody else subscribes by it. Raises what kept a stop from being said where it could not be said
    once in all tries.
    """
    state, clock = LabState(scenario), time.monotonic
    # What we say ourselves comes back on any wire, also on one without robots.
    wire.subscribe(state.robot_topics, shown=False, ours=False)
    resting = ComingToRest(robots_of(scenario), clock())

    def take(timeout: float) -> Event | None:
        if (event := wire.inbox.take(timeout)) is not None:
            resting.hear(event, clock())
        return event

    failures: list[Exception] = []
    for _ in range(TIMES):
        try:
            say_stop(wire, scenario, reason)
        except Exception as error:
            failures.append(error)
        hear_for(state, take, clock, clock() + REPEAT_S)
    if len(failures) == TIMES:
        raise failures[0]
    if state.unheard():
        # Others may have been stopped: who are these?
        wire.subscribe([topics.DIAGNOSTICS], shown=False, ours=False)

    def restless() -> bool:
        unheard = state.unheard()
        return any(each.after_s is None for each in resting.rest(clock()) if each.name not in unheard)

    told_at = clock()
    while (now := clock()) < told_at + _PATIENCE_S and (state.driven(now) or state.unheard()):
        hear_for(state, take, clock, now + _LOOK_S)
    while (now := clock()) < told_at + _REST_S and restless():
        hear_for(state, take, clock, now + _REST_LOOK_S)
    unheard, now = tuple(state.unheard()), clock()
    rest = tuple(each for each in resting.rest(now) if each.name not in unheard)
    nodes = tuple(state.stopped_nodes()) if unheard else ()
    return Stopped(reason, tuple(state.robots.values()), tuple(state.driven(now)), unheard, rest, nodes)
