"""``abreast arm``: let robots be driven again that their guards hold."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import note, say

if TYPE_CHECKING:
    from hil.live.guards_heard import GuardsHeard
    from hil.wire.pubsub import Wire

_LISTENS_S = 1.2
"""Guards report twice a second."""


@click.command("arm", params=wire_options(listens=False))
@click.argument("robot", default="")
@click.option("--scenario", default="turtlebot3", show_default=True, help="Whose robots: a name or a file.")
def command(
    robot: str,
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Let ROBOT, or without one all robots, be driven again: their guards take whoever sends next.

    Ends with 0 once every guard that was heard lets its robot be driven, else with 1, also if none was heard.
    """
    from hil.errors import CheckFailedError, UsageError
    from hil.live.guards_heard import GuardsHeard
    from hil.scenario.files import load_scenario
    from hil.scenario.guarded import with_guards
    from hil.wire import topics
    from hil.wire.lab_robots import robots_of
    from hil.wire.message_types import String
    from hil.wire.messages import encode
    from hil.wire.pubsub import joined

    chosen = with_guards(load_scenario(scenario, overrides))
    known = [each.name for each in robots_of(chosen)]
    if robot and robot not in known:
        raise UsageError(f"{robot!r}: scenario {chosen.name} has no such robot; one of: {', '.join(known)}")
    guards = GuardsHeard()
    endpoints = endpoints_of(connect, None, zenoh_config, secure, "operator")
    with joined(endpoints, chosen, "arm", patience=3.0) as wire:
        wire.subscribe([topics.DIAGNOSTICS], shown=False)
        _hear(wire, guards)
        # Once, and after they were heard: what latches one now is not to be overridden.
        wire.publish(topics.ARM, encode(String(data=robot)))
        _hear(wire, guards)
    if not guards.held:
        whom = f"of {robot}" if robot else "of any robot"
        raise CheckFailedError(f"no guard {whom} was heard; start abreast guard on the robot")
    for name, text in guards.held.items():
        if text and robot in ("", name):
            note(f"abreast arm: {name}: {text}")
    if not guards.are_armed(robot):
        sys.exit(1)
    say(f"{robot or ', '.join(guards.held)} may be driven again")


def _hear(wire: Wire, guards: GuardsHeard) -> None:
    until = time.monotonic() + _LISTENS_S
    while (left := until - time.monotonic()) > 0.0:
        if (event := wire.inbox.take(left)) is not None and event.topic:
            guards.hear(event.payload)
