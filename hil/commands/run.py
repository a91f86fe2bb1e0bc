"""``abreast run``: the main job, live over Zenoh or in lockstep, with its log, figures and verdict."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.figures_option import figures_option
from hil.commands.guard_option import NO_GUARD
from hil.commands.outputs import OutputFolder, new_folder
from hil.commands.own_parts import load_own_parts
from hil.commands.page_options import PagePlace, page_options, page_place, shown_page
from hil.commands.progress import READY, doing, progress
from hil.commands.seconds import DURATION, Seconds
from hil.commands.whole_numbers import Whole
from hil.errors import AbreastError, CheckFailedError, InterruptedRunError, UsageError
from hil.extras import begin_to_judge
from hil.live.crew import Crew
from hil.log.report_json import note, print_json, results_apart, say
from hil.reports.judged_log import claimed, judge_log, made_folder, results_in
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario, refuse_unrunnable
from hil.scenario.guarded import with_guards
from hil.scenario.links import chain_of, links_of, refuse_chain
from hil.scenario.schema import Scenario
from hil.wire.endpoints import DEFAULT_ENDPOINT, SECURE_ENDPOINT

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind
    from hil.live.run import Outcome
    from hil.wire.role_keys import RoleKeys
    from hil.wire.session import Endpoints


@click.command("run", params=page_options())
@click.argument("scenario", default="turtlebot3")
@click.option("--duration", type=DURATION, metavar="S", help="Seconds from the leader's start to the stop.")
@click.option("--seed", type=Whole(0), metavar="N", help="Seed of all noise.")
@click.option("--estimator", metavar="E", help="Estimator: ekf, ukf, imm, or file.py:factory.")
@click.option("--law", metavar="L", help="Law of the follower: independent, or file.py:function.")
@click.option("--out", type=OutputFolder(), metavar="DIR", help="Folder for results.")
@figures_option()
@click.option(
    "--lockstep", is_flag=True, help="On a simulated clock, as fast as it goes; same seed, same bytes."
)
@click.option(
    "--real", is_flag=True, help="With robots and motion capture that exist, in the place of emulated ones."
)
@click.option(
    "--emulate",
    type=click.Choice(("leader", "follower")),
    help="The one of two real robots that is emulated.",
)
@click.option(
    "--leader",
    "driven_by",
    type=click.Choice(("program", "hand")),
    help="Who drives a real leader: its program, after a countdown [program], or a hand.",
)
@click.option("--countdown", type=Seconds(0.0), help="Seconds from when all are ready to the start [3].")
@click.option("--no-guard", is_flag=True, help=NO_GUARD)
@click.option(
    "--listen",
    metavar="ENDPOINT",
    help=f"Where the router listens [a free port on loopback; with --real {DEFAULT_ENDPOINT}].",
)
@click.option("--connect", metavar="ENDPOINT", help="A router that is there, such as a bridge that listens.")
@click.option(
    "--zenoh-config",
    type=click.Path(path_type=Path, dir_okay=False, exists=True),
    metavar="FILE",
    help="Zenoh config file by which all sessions of the run reach a router that is there.",
)
@click.option(
    "--secure",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Keys of all that takes part, by abreast secure init.",
)
@click.option("--live", "page", is_flag=True, help="Show it in a browser, and stop it there.")
@click.option("--apart", is_flag=True, help="Estimator and controller as two processes, live.")
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override any key of the scenario."
)
@click.option(
    "--certify", is_flag=True, help="Publish and judge a guaranteed error radius of every estimate."
)
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object on stdout.")
@results_apart()
def command(
    scenario: str,
    duration: float | None,
    seed: int | None,
    estimator: str | None,
    law: str | None,
    out: Path | None,
    figures: Kind | None,
    overrides: tuple[str, ...],
    certify: bool,
    as_json: bool,
    **live: Any,
) -> None:
    """Drive SCENARIO (a shipped name or a TOML file) through the whole chain, log it and judge it."""
    place = page_place(live)
    begin_to_judge("run")
    how = _how(**live)
    given = {"run.duration_s": duration, "run.seed": seed, "estimator.kind": estimator, "controller.law": law}
    options = [f"{key}={value}" for key, value in given.items() if value is not None]
    if how is None or not how.crew.real:
        options.append("source.emulated=")
    elif how.crew.emulate:
        options.append(f"source.emulated={how.crew.emulate}")
    chosen = load_scenario(scenario, [*overrides, *options, *([CERTIFY] if certify else [])])
    refuse_unrunnable(chosen)
    links_of(chosen)
    chosen = with_guards(chosen, present=how is not None and how.crew.guarded)
    if how is not None and (emulated := chosen.source.emulated):
        refuse_chain(chosen, "--emulate is for a pair: leave it out")
        how = replace(how, crew=replace(how.crew, emulate=emulated))
    if how is not None:
        how = replace(how, page=place)
    load_own_parts(chosen)
    folder = _folder(chosen, out)
    with claimed(folder):
        _run(chosen, folder, how, figures, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Live:
    """How to run live: where all meet, None for a free port, who takes part, and where it is shown."""

    endpoints: Endpoints | None
    crew: Crew
    keys: RoleKeys | None = None
    page: PagePlace | None = None


def _how(
    lockstep: bool,
    apart: bool,
    real: bool,
    emulate: str | None,
    driven_by: str | None,
    countdown: float | None,
    no_guard: bool,
    listen: str | None,
    connect: str | None,
    zenoh_config: Path | None,
    secure: Path | None,
) -> _Live | None:
    """How to run live, None for in lockstep.

    Raises :class:`UsageError` for options that exclude each other.
    """
    apart_from_one = {"--apart": apart, "--real": real, "--no-guard": no_guard, "--secure": secure}
    option = next((each for each, given in apart_from_one.items() if given), "")
    if lockstep and option:
        raise UsageError(
            f"{option}: a run in lockstep is one process without a wire; leave {option} or --lockstep out"
        )
    leads = "--leader" if driven_by is not None else "--countdown" if countdown is not None else ""
    if (leads or emulate is not None) and not real:
        raise UsageError(f"{leads or '--emulate'}: is for a run with real robots; give --real too")
    if leads and emulate == "leader":
        raise UsageError(f"{leads}: is for a leader that exists; leave it out, or --emulate leader")
    if driven_by == "hand" and countdown is not None:
        raise UsageError("--countdown: who drives the leader by hand counts himself; leave it out")
    if sum(each is not None for each in (listen, connect, zenoh_config)) > 1:
        raise UsageError(
            "--listen, --connect, --zenoh-config: each says where the router is; leave all but one out"
        )
    if lockstep:
        return None
    by_hand = driven_by == "hand"
    crew = Crew(
        apart=apart,
        real=real,
        emulate=emulate or "",
        by_hand=by_hand,
        countdown_s=countdown,
        guarded=not no_guard,
    )
    from hil.wire.role_keys import RoleKeys
    from hil.wire.roles import OPERATOR, ROUTER
    from hil.wire.session import Endpoints

    keys = RoleKeys(secure, OPERATOR if connect else ROUTER) if secure else None
    if real and not (listen or connect or zenoh_config):
        listen = SECURE_ENDPOINT if secure else DEFAULT_ENDPOINT
    if listen or connect or zenoh_config:
        return _Live(Endpoints(connect, listen, zenoh_config, keys), crew)
    return _Live(None, crew, keys)


def _run(chosen: Scenario, folder: Path, live: _Live | None, figures: Kind | None, *, as_json: bool) -> None:
    from hil.judge.made_by import law_failure
    from hil.log.rotating_log import log_place, pieces_of

    named = folder / "run.mcap"
    log_path = named if live is None else log_place(named, chosen.recorder)
    if log_path.exists():
        raise UsageError(f"{log_path} exists already; give another --out, or move it away")
    failure, left, interrupted, signal_number = "", "", "", 0
    broke = "the run broke down: "
    timing: dict[str, dict[str, float]] = {}
    if live is None:
        timing["lockstep"], interrupted, signal_number = _lockstep(chosen, named)
    else:
        outcome = _live(chosen, named, live)
        failure, left, interrupted = outcome.failure, f"{outcome.robots}, ", _interrupted(outcome)
        signal_number = outcome.signal
        if outcome.stopped:
            # As somebody wanted it: no words that alarm.
            broke = ""
        if outcome.recorded and not log_path.exists():
            gone = f"log {log_path} is not there any more: somebody moved or deleted it during the run"
            raise CheckFailedError(f"{failure}; {gone}" if failure else gone)
    if not log_path.exists():
        raise CheckFailedError(failure or "interrupted before anything was recorded")
    try:
        if live is not None:
            for piece in pieces_of(log_path):
                # What is in a folder of pieces is taken for one of them by its name.
                _make_whole(piece, piece.with_suffix(".cut.mcap" if piece == log_path else ".mcap.cut"))
        summary = _judge(log_path, folder, figures)
        if as_json:
            # How long it took is no part of the verdict, which is the same for every run of a seed.
            print_json(summary | timing)
        failure = failure or law_failure(summary)
    finally:
        # Also if there is no room for a verdict, say: what went wrong first is what to tell.
        if failure:
            raise CheckFailedError(f"{broke}{failure}; {left}the log is {log_path}")
    if interrupted:
        raise InterruptedRunError(interrupted, signal_number)


def _interrupted(outcome: Outcome) -> str:
    """That a run was interrupted, in words; empty if it was not."""
    if not outcome.interrupted:
        return ""
    return f"interrupted after {outcome.duration_s:.1f} s; {outcome.robots}, the log is whole"


def _folder(scenario: Scenario, out: Path | None) -> Path:
    return new_folder(scenario.name) if out is None else made_folder(out)


@collector_paused()
def _lockstep(scenario: Scenario, log_path: Path) -> tuple[dict[str, float], str, int]:
    """How long it took, and that it was interrupted, if it was, and by which signal."""
    from hil.live.interrupts import Interrupt

    duration_s = scenario.run.duration_s
    with doing(READY):
        from hil.lockstep.run import prepared, timed_lockstep
        from hil.log.resolved_scenario import write_resolved

        write_resolved(scenario, log_path.parent)
        ready = prepared(scenario)
    with Interrupt() as interrupt, progress("driving", duration_s) as tell:

        def go_on(driven_s: float) -> bool:
            tell(driven_s)
            return interrupt.go_on()

        timing = timed_lockstep(scenario, log_path, ready, go_on)
    took, times = timing["wall_s"], timing["times_real_time"]
    driven_s = took * times
    note(f"{driven_s:g} s in lockstep in {took:.2f} s ({times:.0f} times real time)")
    if not interrupt.number:
        return timing, "", 0
    return timing, f"interrupted after {driven_s:.1f} of {duration_s:g} s, the log is whole", interrupt.number


def _live(scenario: Scenario, log_path: Path, live: _Live) -> Outcome:
    from rich.console import Console
    from rich.text import Text

    from hil.commands.found_runs import how_to_stop
    from hil.live.daemon import Ending
    from hil.live.finding_lines import FindingLines, WaitingLines
    from hil.live.run import run_live
    from hil.live.run_monitor import Snapshot
    from hil.log.resolved_scenario import RESOLVED
    from hil.wire.session import Endpoints, reserved_endpoint

    ending = Ending()
    ending.on_signals()
    console = Console(file=sys.stderr)
    starting = console.status(f"starting {', '.join(live.crew.daemons)}")
    with ExitStack() as held:
        protocol = "tls" if live.keys else "tcp"
        endpoints = live.endpoints or Endpoints(
            listen=held.enter_context(reserved_endpoint(protocol)), keys=live.keys
        )
        status = held.enter_context(starting)
        if live.crew.real:
            console.print(Text(f"robots and bridges connect to {endpoints.describe()}"), soft_wrap=True)

        def say(line: str) -> None:
            console.print(Text(line), soft_wrap=True)

        page = held.enter_context(shown_page(live.page, endpoints, say)) if live.page else None
        lines = FindingLines(say)
        # Who does not watch a terminal is told as well, once for whatever is waited for.
        aside = Console(file=sys.stderr, quiet=console.is_terminal)
        waiting = WaitingLines(lambda line: aside.print(Text(line), soft_wrap=True))

        resolved = log_path.parent / RESOLVED
        untold = [how_to_stop(endpoints.joining, scenario, resolved)]

        def show(snapshot: Snapshot, elapsed: float | None) -> None:
            # Its router is there by now.
            while untold:
                say(f"running; stop it by Ctrl-C, or from elsewhere by: {untold.pop()}")
            if page is not None:
                page.see_to(resolved, endpoints.joining)
            for node, findings in list(snapshot.findings.items()):
                lines.note(node, findings)
            # What is on the wire may look like markup.
            if elapsed is not None:
                status.update(Text(snapshot.line(elapsed, scenario.run.duration_s)))
            elif live.crew.real and (waits := snapshot.waits_for(())):
                status.update(Text(waits))
                waiting.hear(waits)

        try:
            outcome = run_live(scenario, log_path, endpoints, ending, show, live.crew)
        finally:
            ending.leave_signals()
    return outcome


def _make_whole(log_path: Path, cut: Path) -> None:
    """Recover the log if the recorder was cut off; what it left stays beside it under another name."""
    from hil.log.reader import read_log
    from hil.log.recovery import recover

    try:
        read_log(log_path)
    except UsageError:
        whole = log_path.with_suffix(".whole")
        try:
            recover(log_path, whole)
        except AbreastError as error:
            note(f"the log was cut off and stays so: {error}")
            if isinstance(error, UsageError) and cut.suffix == ".cut":
                # The other pieces are read without one of which nothing is left.
                log_path.rename(cut)
            return
        log_path.rename(cut)
        whole.rename(log_path)
        note(f"the log was cut off; {log_path} is what could be recovered, {cut} what there was")


@collector_paused()
def _judge(log_path: Path, folder: Path, figures: Kind | None) -> dict[str, Any]:
    """Judge the log, leave summary, picture and report beside it, and print the verdict."""
    from hil.judge.summary_text import print_summary
    from hil.log.metadata import scenario_of
    from hil.log.opened import opened_log
    from hil.log.reader import read_log

    log = opened_log(log_path) if log_path.is_dir() else read_log(log_path)
    if (own := scenario_of(log)) is not None and chain_of(own) is not None:
        from hil.commands.chain_results import judge_run

        return judge_run(log, own, folder, figures)
    with doing("judging"):
        summary = judge_log(log, folder, figures)
    print_summary(summary)
    say(results_in(folder))
    return summary
