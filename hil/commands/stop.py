"""``abreast stop``: stop all robots of a lab, and see that they are told so."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click

from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import note, say

_REPEAT_S = 0.1
_TIMES = 5
_PATIENCE_S = 2.0
_LOOK_S = 0.3


@click.command("stop", params=wire_options(listens=False))
@click.argument("reason", default="stopped by hand")
@click.option("--scenario", default="turtlebot3", show_default=True, help="Whose robots: a name or a file.")
def command(
    reason: str,
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Stop everybody for REASON: controllers by a stop message, and robots by a command to stand.

    Ends with 0 once all robots are told to stand, are heard of, and nobody tells one otherwise, else with 1.
    """
    from hil.live.lab_state import LabState, hear_for
    from hil.nodes.link_nodes import leader_standstill, standstill
    from hil.scenario.files import load_scenario
    from hil.scenario.links import links_of
    from hil.wire import topics
    from hil.wire.message_types import String
    from hil.wire.messages import encode
    from hil.wire.pubsub import joined

    chosen = load_scenario(scenario, overrides)
    state, links = LabState(chosen), links_of(chosen)
    clock = time.monotonic
    endpoints = endpoints_of(connect, None, zenoh_config, secure, "operator")
    with joined(endpoints, chosen, "stop", patience=3.0) as wire:
        # What we say ourselves comes back on any wire, also on one without robots.
        wire.subscribe(state.robot_topics, shown=False, ours=False)
        for _ in range(_TIMES):
            wire.publish(topics.STOP, encode(String(data=reason)))
            now_ns = time.time_ns()
            for still in (leader_standstill(chosen, now_ns), *(standstill(link, now_ns) for link in links)):
                # Behind a guard it is the guard that lets a robot stand, by the stop.
                if wire.may_publish(still.topic):
                    wire.publish(still.topic, still.payload)
            hear_for(state, wire.inbox.take, clock, clock() + _REPEAT_S)
        until = clock() + _PATIENCE_S
        while ((driven := state.driven(clock())) or state.unheard()) and clock() < until:
            hear_for(state, wire.inbox.take, clock, clock() + _LOOK_S)
    if driven:
        note(f"abreast stop: somebody still drives {', '.join(driven)}; use the robot's switch")
        sys.exit(1)
    if unheard := state.unheard():
        note(
            f"abreast stop: nothing was heard of {', '.join(unheard)} on this wire; "
            "give --scenario FILE of your lab, and see that its bridge runs"
        )
        sys.exit(1)
    say(f"{', '.join(state.robots.values())} told to stand ({reason})")
