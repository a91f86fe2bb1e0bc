"""``abreast emulator``, ``follower``, ``estimator`` and so on: one daemon each, in the foreground."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.daemon_workers import WORKERS, Order, on_report, overheard, serve_alone, watch_of
from hil.commands.guard_option import NO_GUARD
from hil.commands.natnet_options import NatNetOptions, natnet_options
from hil.commands.outputs import OutputFile
from hil.commands.own_parts import load_own_parts
from hil.commands.seconds import DURATION, Seconds
from hil.commands.wire_options import endpoints_of, wire_options
from hil.extras import why_interpreted
from hil.log.report_json import note
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.scenario.links import HOSTED, link_of, links_of

if TYPE_CHECKING:
    from hil.live.daemon import Worker


def daemon_command(name: str, summary: str) -> click.Command:
    """The command of one daemon."""

    def callback(
        scenario: str,
        connect: str | None,
        listen: str | None,
        secure: Path | None,
        zenoh_config: Path | None,
        duration: float | None,
        overrides: tuple[str, ...],
        out: Path | None = None,
        needs: str = "estimator,controller",
        followers: tuple[str, ...] = (),
        tethered: bool = False,
        certify: bool = False,
        countdown: float = 0.0,
        by_hand: bool = False,
        no_guard: bool = False,
        **natnet: Any,
    ) -> None:
        # Wire and messages take a third of a second to load, which help needs not.
        with collector_paused():
            from hil.live.daemon import Ending, Presence, run_daemon
            from hil.wire.messages import prepare
            from hil.wire.topics import types_of

        ending = Ending()
        ending.on_signals()
        if tethered:
            ending.on_parent_gone()
        options = NatNetOptions(**natnet)
        alone = options.natnet and not (connect or listen or zenoh_config or secure)
        chosen = load_scenario(scenario, (*overrides, CERTIFY) if certify else overrides)
        chosen = with_guards(chosen, present=not no_guard)
        if (why := why_interpreted()) and not tethered:
            note(f"abreast {name}: interpreted, as {why}: slower, bit for bit the same")
        if name in HOSTED:
            load_own_parts(chosen, estimates=name != "controller")
        needed = frozenset(filter(None, needs.split(",")))
        links = tuple(link_of(chosen, name) for name in dict.fromkeys(followers)) or links_of(chosen)
        order = Order(chosen, links, out, needed, options, countdown, by_hand, secure is not None)
        if alone:
            serve_alone(order, ending, duration)
            return
        endpoints = endpoints_of(connect, listen, zenoh_config, secure, name)

        def say_ready() -> None:
            whom = f" for {', '.join(followers)}" if followers else ""
            note(f"abreast {name}: ready{whom}, {chosen.name} on {endpoints.describe()}")

        prepare(types_of(chosen).values())
        dropped = run_daemon(
            collector_paused()(lambda: _made(name, order)),
            chosen,
            endpoints,
            ending,
            duration,
            say_ready,
            Presence(name, watch_of(name, order), overheard(name, order), on_report()),
        )
        if dropped:
            note(f"abreast {name}: {dropped} messages came too fast and were dropped")

    options: list[click.Parameter] = [
        click.Argument(["scenario"]),
        *wire_options(),
        click.Option(["--duration"], type=DURATION, help="End after S seconds."),
        click.Option(["--no-guard"], is_flag=True, help=NO_GUARD),
        click.Option(["--tethered"], is_flag=True, hidden=True),
    ]
    if name == "recorder":
        options.append(
            click.Option(["--out"], type=OutputFile(), required=True, help="Log to write (.mcap).")
        )
    if name in HOSTED:
        needs = "Daemons that must be well before it uses measurements, by commas, such as recorder."
        options.append(click.Option(["--needs"], default="", help=needs))
        whom = "A follower of a chain to serve, by its name; may be given again. Without it all."
        options.append(click.Option(["--follower", "followers"], multiple=True, metavar="NAME", help=whom))
    if name in ("follower", "estimator"):
        what = "Publish a guaranteed error radius of every estimate."
        options.append(click.Option(["--certify"], is_flag=True, help=what))
    if name == "leader":
        options += _leader_options()
    if name in ("emulator", "leader"):
        needs = "Daemons that must be well before the leader sets off, by commas."
        options.append(
            click.Option(["--needs"], default="estimator,controller", show_default=True, help=needs)
        )
    if name == "emulator":
        options += natnet_options()
    return click.Command(name, callback=callback, params=options, help=f"Run {summary}.")


def _made(name: str, order: Order) -> Worker:
    worker = WORKERS[name](order)
    if name not in HOSTED or not order.needs:
        return worker
    from hil.live.held_worker import HeldWorker

    return HeldWorker(worker, order.needs, order.links, lambda line: note(f"abreast {name}: {line}"))


def _leader_options() -> list[click.Parameter]:
    from hil.nodes.leader_driver import COUNTDOWN_S

    count = "Seconds from when all are well to when the leader sets off."
    hand = "Drive nobody: tell only when the leader sets off, whoever drives it."
    return [
        click.Option(["--countdown"], type=Seconds(0.0), default=COUNTDOWN_S, show_default=True, help=count),
        click.Option(["--by-hand"], is_flag=True, help=hand),
    ]
