"""``abreast replay``: a log through the same steps again, verified, re-estimated, judged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.seconds import Seconds
from hil.errors import CheckFailedError, UsageError
from hil.log.report_json import print_json
from hil.reports.judged_log import leave, made_folder
from hil.scenario.certify import CERTIFY, same_steps

if TYPE_CHECKING:
    from hil.judge.run_data import RunData
    from hil.log.reader import Log
    from hil.replay.rerun import Replay
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
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a scenario key.")
@click.option("--from", "from_s", type=Seconds(), metavar="S", help="Judge from here on.")
@click.option("--to", "to_s", type=Seconds(), metavar="S", help="Judge up to here.")
@click.option("--csv", "table", type=click.Path(path_type=Path), metavar="FILE", help="Write the estimates.")
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), metavar="DIR", help="Folder for results."
)
@click.option(
    "--strict", is_flag=True, help="Fail if an error lies outside its extended bound or certified radius."
)
@click.option("--certify", is_flag=True, help="Judge a guaranteed error radius of every estimate too.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object on stdout.")
@collector_paused()
def command(
    log: Path,
    verify: bool,
    estimator: str | None,
    law: str | None,
    leader: str | None,
    follower: str | None,
    chart: str | None,
    overrides: tuple[str, ...],
    from_s: float | None,
    to_s: float | None,
    table: Path | None,
    out: Path | None,
    strict: bool,
    certify: bool,
    as_json: bool,
) -> None:
    """Run LOG through the very steps that run live, and judge what comes out.

    --from and --to are seconds since the leader set off, for imported recordings the source's own time; the
    steps always begin where the log does.
    """
    from hil.judge.replay_verdict import (
        fed_json,
        parity_json,
        print_fed,
        run_data_of_replay,
        violated_bounds,
        why_not_same,
    )
    from hil.judge.summary import summarise
    from hil.judge.summary_text import print_summary
    from hil.log.reader import read_log
    from hil.replay.odometry_alignment import judge_own_motion

    if from_s is not None and to_s is not None and to_s <= from_s:
        raise UsageError(f"--to {to_s:g}: expected more than --from {from_s:g}")
    given, overrides = _with_sources(read_log(log), estimator, law, overrides)
    if certify:
        overrides = (*overrides, CERTIFY)
    if chart is None and follower is None and (chain := _chain(given, leader, overrides, table)):
        from hil.commands.chain_results import Wishes, replay_run

        replay_run(given, chain, Wishes(verify, strict, as_json, from_s, to_s, out))
        return
    played = _played(given, chart, leader, follower, overrides, verify=verify)
    run_data = run_data_of_replay(given, played, from_s, to_s)
    summary = summarise(run_data)
    if chart is None and (own_motion := judge_own_motion(given, played.scenario)):
        summary["own_motion"] = own_motion
    if verify:
        summary["parity"] = parity_json(played)
    summary |= fed_json(played)
    print_fed(given, played)
    _write(run_data, summary, table, out)
    print_summary(summary)
    for name, what in (("commands", "commands to the robot"), ("certified", "certified estimates")):
        if name in played.parity and (unrecorded := played.parity[name].unrecorded):
            click.echo(f"{unrecorded} {what} are not in the log: the recorder missed them", err=True)
    for name, restarts in played.restarts.items():
        if restarts:
            click.echo(f"the {name} was started again during the run (times: {restarts})", err=True)
    if as_json:
        print_json(summary)
    if verify and (reason := why_not_same(given, played)):
        raise CheckFailedError(reason)
    if strict and (broken := violated_bounds(summary)):
        counts = ", ".join(f"{name} by {count}" for name, count in broken.items())
        raise CheckFailedError(f"log {log}: bounds violated (samples): {counts}")


def _with_sources(
    log: Log, estimator: str | None, law: str | None, overrides: tuple[str, ...]
) -> tuple[Log, tuple[str, ...]]:
    """Log with its own law and estimator where they are now, and overrides for others than its own."""
    from hil.log.description import RECORD
    from hil.log.metadata import scenario_of
    from hil.log.own_sources import with_sources
    from hil.scenario.brought import settled_references

    chosen = settled_references(law, estimator)
    placed = with_sources(log, chosen, RECORD)
    own = scenario_of(placed)
    kept = {} if own is None else {"law": own.controller.law, "estimator": own.estimator.kind}
    keys = {"law": "controller.law", "estimator": "estimator.kind"}
    others = [
        f"{keys[noun]}={text}" for noun, text in chosen.items() if text is not None and text != kept.get(noun)
    ]
    return placed, (*overrides, *others)


def _played(
    log: Log,
    chart: str | None,
    leader: str | None,
    follower: str | None,
    overrides: Sequence[str],
    *,
    verify: bool,
) -> Replay:
    """Replay of one of our logs, or of another lab's by its topic map."""
    from hil.judge.replay_verdict import refuse_other_steps
    from hil.log.metadata import scenario_of
    from hil.replay.feeding import guessed_link, why_guessed
    from hil.replay.rerun import replay, replay_fed, replay_foreign, replay_link
    from hil.replay.topic_map import load_topic_map
    from hil.scenario.files import with_overrides
    from hil.scenario.links import chain_of, link_of

    if chart is not None:
        if verify:
            raise UsageError("--verify: a log that needs --map has no estimates of ours; leave one out")
        return replay_foreign(log, load_topic_map(chart, leader, follower, overrides))
    own = scenario_of(log)
    if own is None:
        link = guessed_link(log, leader, follower, overrides)
        return replay_fed(log, link, why_guessed(link))
    if chain_of(own) is not None and follower is not None:
        _refuse_leader(leader)
        link, was = link_of(with_overrides(own, overrides), follower), link_of(own, follower)
        if verify:
            refuse_other_steps(link.scenario, was.scenario)
        return replay_link(log, link, was)
    names = {"leader.name": leader, "follower.name": follower}
    renamed = [f"{key}={name}" for key, name in names.items() if name is not None]
    chosen = with_overrides(own, [*overrides, *renamed])
    if verify and not same_steps(chosen, own):
        raise UsageError(
            f"--verify compares with what was recorded: by {own.estimator.kind}, of leader "
            f"{own.leader.name!r} and follower {own.follower.name!r}, with the log's own settings; leave out "
            "what changes that"
        )
    return replay(log, chosen)


def _chain(log: Log, leader: str | None, overrides: Sequence[str], table: Path | None) -> Scenario | None:
    """Scenario to replay all followers of a chain by; None for the log of a pair, or of others."""
    from hil.log.metadata import scenario_of
    from hil.scenario.files import with_overrides
    from hil.scenario.links import chain_of, links_of

    own = scenario_of(log)
    if own is None or chain_of(own) is None:
        return None
    _refuse_leader(leader)
    if table is not None:
        known = ", ".join(link.follower for link in links_of(own))
        raise UsageError(
            f"--csv {table}: a file holds the estimates of one follower; give --follower with one of "
            f"{known}, or --out for all"
        )
    return with_overrides(own, overrides)


def _refuse_leader(leader: str | None) -> None:
    if leader is not None:
        raise UsageError(
            f"--leader {leader!r}: in the log of a chain everybody follows the robot before; "
            "leave it out, and give --follower"
        )


def _write(run_data: RunData, summary: dict[str, Any], table: Path | None, out: Path | None) -> None:
    from hil.judge.replay_verdict import evaluated
    from hil.replay.estimate_csv import write_estimates

    if table is not None:
        write_estimates(evaluated(run_data), table)
    if out is None:
        return
    write_estimates(evaluated(run_data), made_folder(out) / "estimates.csv")
    leave(run_data, summary, out, "replay.png")
