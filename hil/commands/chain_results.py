"""What ``abreast run`` and ``abreast replay`` make of the log of a chain: all followers, each by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hil.errors import CheckFailedError
from hil.judge.chain_pairs import driven_trajectory
from hil.judge.chain_summary import summarise_chain
from hil.judge.chain_text import print_chain
from hil.judge.replay_verdict import (
    evaluated,
    fed_json,
    parity_json,
    print_fed,
    refuse_other_steps,
    run_data_of_replay,
    violated_bounds,
    why_not_same,
)
from hil.judge.run_data import RunData, run_data_of_link
from hil.log.metadata import scenario_of
from hil.log.reader import Log
from hil.log.report_json import print_json, write_json
from hil.replay.estimate_csv import write_estimates
from hil.replay.rerun import replay_chain
from hil.reports.judged_log import made_folder
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario


@dataclass(frozen=True, slots=True)
class Wishes:
    """What is asked of a replay besides the estimates: a comparison, strictness, where files go, a span."""

    verify: bool
    strict: bool
    as_json: bool
    from_s: float | None
    to_s: float | None
    out: Path | None


def judge_run(log: Log, scenario: Scenario, folder: Path) -> dict[str, Any]:
    """Judge the log of a run, and leave summary and picture beside it."""
    runs = [run_data_of_link(log, link) for link in links_of(scenario)]
    summary = summarise_chain(scenario, runs)
    _write(scenario, runs, summary, folder, "run.png")
    print_chain(summary)
    click.echo(
        f"a page is made of one follower at a time: abreast replay {log.path} "
        f"--follower {runs[-1].scenario.follower.name} --out DIR",
        err=True,
    )
    return summary


def replay_run(log: Log, chosen: Scenario, wishes: Wishes) -> None:
    """Replay the log of a chain by a scenario, and do with the result what is wished."""
    own = scenario_of(log)
    if wishes.verify and own is not None:
        refuse_other_steps(chosen, own)
    played = replay_chain(log, chosen)
    runs = [run_data_of_replay(log, each, wishes.from_s, wishes.to_s) for each in played]
    summary = summarise_chain(chosen, runs)
    for pair, each in zip(summary["pairs"], played, strict=True):
        pair |= fed_json(each)
    print_fed(log, *played)
    if wishes.verify:
        summary["parity"] = parity_json(*played)
        for pair, each in zip(summary["pairs"], played, strict=True):
            pair["parity"] = parity_json(each)
    if wishes.out is not None:
        _write(chosen, runs, summary, made_folder(wishes.out), "replay.png")
        for run_data in runs:
            name = run_data.scenario.follower.name
            write_estimates(evaluated(run_data), wishes.out / f"estimates-{name}.csv")
    print_chain(summary)
    if wishes.as_json:
        print_json(summary)
    reasons = [why_not_same(log, each) for each in played] if wishes.verify else []
    if reason := next(filter(None, reasons), ""):
        raise CheckFailedError(reason)
    if wishes.strict:
        _refuse_violated(log, summary)


def _write(
    scenario: Scenario, runs: Sequence[RunData], summary: dict[str, Any], folder: Path, picture: str
) -> None:
    write_json(summary, folder / "summary.json")
    trajectory = driven_trajectory(runs)
    if trajectory is None:
        click.echo("no picture: the log does not tell where the robots really were", err=True)
        return
    from hil.figures.chain_figures import draw_chain

    draw_chain(scenario, trajectory, float(trajectory.t[-1]), folder / picture)


def _refuse_violated(log: Log, summary: dict[str, Any]) -> None:
    broken = [
        f"{pair['follower']}: {name} by {count}"
        for pair in summary["pairs"]
        for name, count in violated_bounds(pair).items()
    ]
    if broken:
        raise CheckFailedError(f"log {log.path}: bounds violated (samples): {', '.join(broken)}")
