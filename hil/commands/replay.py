"""``abreast replay``: a log through the same steps again, verified, re-estimated, judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.figures_option import figures_option, refuse_nowhere
from hil.commands.outputs import OutputFile, OutputFolder
from hil.commands.progress import READY, doing, progress
from hil.commands.replay_folder import refuse_for_folder, replay_folder
from hil.commands.seconds import Seconds
from hil.commands.whole_numbers import Whole
from hil.errors import CheckFailedError, InterruptedRunError, UsageError
from hil.extras import begin_to_judge
from hil.live.interrupts import Interrupt
from hil.log.report_json import note, print_json, print_text, results_apart, say
from hil.reports.judged_log import leave, made_folder, results_in

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind
    from hil.judge.replayed import ReplayChoice, Replayed
    from hil.judge.run_data import RunData
    from hil.log.reader import Log
    from hil.scenario.schema import Scenario


@click.command("replay")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--verify", is_flag=True, help="Compare with what was recorded, bit for bit.")
@click.option(
    "--estimator", metavar="E", help="Estimator in place of the log's: ukf, smoother, file.py:factory."
)
@click.option("--law", metavar="L", help="Where the log's own law is now, or another one to judge by.")
@click.option("--leader", metavar="NAME", help="Name of the leader's body.")
@click.option("--follower", metavar="NAME", help="Name of the follower's body.")
@click.option("--map", "chart", metavar="FILE", help="Names the topics of a log that is not abreast's.")
@click.option("--propose-map", "propose", is_flag=True, help="Print a map for LOG's topics, and no more.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--from", "from_s", type=Seconds(), metavar="S", help="Judge from here on.")
@click.option("--to", "to_s", type=Seconds(), metavar="S", help="Judge up to here.")
@click.option("--csv", "table", type=OutputFile(), metavar="FILE", help="Write the estimates.")
@click.option("--out", type=OutputFolder(), metavar="DIR", help="Folder for results.")
@figures_option()
@click.option(
    "--strict", is_flag=True, help="Fail if an error lies outside its extended bound or certified radius."
)
@click.option("--certify", is_flag=True, help="Judge a guaranteed error radius of every estimate too.")
@click.option(
    "--workers",
    type=Whole(1),
    metavar="N",
    help="Processes for a folder of logs [all].",
)
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler for a folder of logs.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object on stdout.")
@results_apart()
@collector_paused()
def command(
    log: Path,
    verify: bool,
    estimator: str | None,
    law: str | None,
    leader: str | None,
    follower: str | None,
    chart: str | None,
    propose: bool,
    overrides: tuple[str, ...],
    from_s: float | None,
    to_s: float | None,
    table: Path | None,
    out: Path | None,
    figures: Kind | None,
    strict: bool,
    certify: bool,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Run LOG through the very steps that run live, and judge what comes out.

    Of a folder of logs each is judged, and the worst are named: into LOG-out, if there is no --out.

    --from and --to are seconds since the leader set off, for imported recordings the source's own time; the
    steps always begin where the log does.
    """
    from hil.log.log_folder import is_folder_of_logs
    from hil.log.opened import opened_log

    many = is_folder_of_logs(log)
    if not many and (workers or scheduler):
        raise UsageError(f"log {log}: is a single log; --workers and --scheduler are for a folder of logs")
    if not propose:
        begin_to_judge("replay")
    # First of all: what replays takes over a second to load, and to compile where that is still to be done.
    if many:
        refuse_for_folder(log, {"--csv": table, "--propose-map": propose, "--figures": figures})
    refuse_nowhere(figures, out)
    given = None if many else opened_log(log)
    if given is not None and propose:
        from hil.replay.proposed_map import proposed_map

        print_text(proposed_map(given, leader, follower))
        return

    with doing(READY):
        from hil.judge.replay_verdict import print_fed, violated_bounds
        from hil.judge.replayed import ReplayChoice, chain_in
        from hil.judge.summary_text import print_summary

    interrupt = Interrupt()
    choice = ReplayChoice(
        estimator=estimator,
        law=law,
        leader=leader,
        follower=follower,
        chart=chart,
        overrides=overrides,
        from_s=from_s,
        to_s=to_s,
        verify=verify,
        certify=certify,
    )
    if given is None:
        replay_folder(log, choice, out, workers=workers, scheduler=scheduler, strict=strict, as_json=as_json)
        return
    if (chain := chain_in(given, choice)) is not None:
        from hil.commands.chain_results import leave_replay

        _refuse_table(table, chain)
        done = _followed(given, choice, interrupt)
        compares = verify and not _nothing_compared(interrupt, done)
        leave_replay(given, done, out, figures, as_json=as_json, verify=compares, strict=strict)
        _refuse_interrupted(interrupt)
        _refuse_damage(given, done)
        return
    done = _followed(given, choice, interrupt)
    (played,), (run_data,), summary = done.played, done.runs, done.summary
    print_fed(given, played)
    _write(run_data, summary, table, out, figures)
    print_summary(summary)
    if out is not None:
        say(results_in(out))
    for name, what in (("commands", "commands to the robot"), ("certified", "certified estimates")):
        if name in played.parity and (unrecorded := played.parity[name].unrecorded):
            note(f"{unrecorded} {what} are not in the log: the recorder missed them")
    for name, restarts in played.restarts.items():
        if restarts:
            note(f"the {name} was started again during the run (times: {restarts})")
    if as_json:
        print_json(summary)
    if verify and not _nothing_compared(interrupt, done) and (reason := done.why_not_same(given)):
        raise CheckFailedError(reason)
    if strict and (broken := violated_bounds(summary)):
        counts = ", ".join(f"{name} by {count}" for name, count in broken.items())
        raise CheckFailedError(f"log {log}: bounds violated (samples): {counts}")
    _refuse_interrupted(interrupt)
    _refuse_damage(given, done)


def _followed(log: Log, choice: ReplayChoice, interrupt: Interrupt) -> Replayed:
    """The replay, with its progress; of one that is interrupted what there is by then."""
    from hil.judge.replayed import replayed

    with interrupt, progress("replaying", 100.0, "%") as tell:

        def go_on(share: float) -> bool:
            tell(100.0 * share)
            return interrupt.go_on()

        return replayed(log, replace(choice, go_on=go_on))


def _nothing_compared(interrupt: Interrupt, done: Replayed) -> bool:
    """Whether a replay was interrupted before anything of it could be compared."""
    parity = done.summary.get("parity", {}).values()
    return bool(interrupt.number) and not any(part["compared"] for part in parity)


def _refuse_interrupted(interrupt: Interrupt) -> None:
    """End as interrupted, now that what there is has been told."""
    if interrupt.number:
        raise InterruptedRunError("interrupted; this is what was replayed by then", interrupt.number)


def _refuse_damage(log: Log, done: Replayed) -> None:
    """Fail for what is gone of a log, now that the rest has been told."""
    if done.damage:
        raise CheckFailedError(f"log {log.path}: {done.damage}")


def _refuse_table(table: Path | None, chain: Scenario) -> None:
    from hil.scenario.links import links_of

    if table is not None:
        known = ", ".join(link.follower for link in links_of(chain))
        raise UsageError(
            f"--csv {table}: a file holds the estimates of one follower; give --follower with one of "
            f"{known}, or --out for all"
        )


def _write(
    run_data: RunData, summary: dict[str, Any], table: Path | None, out: Path | None, figures: Kind | None
) -> None:
    from hil.judge.replay_verdict import evaluated
    from hil.replay.estimate_csv import write_estimates

    if table is not None:
        write_estimates(evaluated(run_data), table)
    if out is None:
        return
    write_estimates(evaluated(run_data), made_folder(out) / "estimates.csv")
    leave(run_data, summary, out, "replay.png", figures)
