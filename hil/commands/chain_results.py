"""What ``abreast run`` and ``abreast replay`` make of the log of a chain: all followers, each by itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.commands.progress import doing
from hil.errors import CheckFailedError
from hil.extras import left_out_if_missing
from hil.judge.chain_pairs import driven_trajectory
from hil.judge.chain_summary import summarise_chain
from hil.judge.chain_text import print_chain
from hil.judge.replay_verdict import evaluated, print_fed, violated_bounds
from hil.judge.replayed import Replayed
from hil.judge.run_data import RunData, run_data_of_link
from hil.log.reader import Log
from hil.log.report_json import note, print_json, say, write_json
from hil.log.written_aside import write_text_aside
from hil.replay.estimate_csv import write_estimates
from hil.reports.judged_log import made_folder, results_in
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind


def judge_run(log: Log, scenario: Scenario, folder: Path, figures: Kind | None = None) -> dict[str, Any]:
    """Judge the log of a run, and leave summary, picture and page beside it."""
    with doing("judging"):
        runs = [run_data_of_link(log, link) for link in links_of(scenario)]
        summary = summarise_chain(scenario, runs)
        leave_chain(scenario, runs, summary, folder, "run.png", figures)
    print_chain(summary)
    say(results_in(folder))
    return summary


def leave_replay(
    log: Log,
    done: Replayed,
    out: Path | None,
    figures: Kind | None,
    *,
    as_json: bool,
    verify: bool,
    strict: bool,
) -> None:
    """Leave what came of the replay of a chain's log where it is wished, print it, and check it."""
    summary = done.summary
    print_fed(log, *done.played)
    if out is not None:
        leave_chain(done.scenario, done.runs, summary, made_folder(out), "replay.png", figures)
        for run_data in done.runs:
            write_estimates(evaluated(run_data), out / f"estimates-{run_data.scenario.follower.name}.csv")
    print_chain(summary)
    if out is not None:
        say(results_in(out))
    if as_json:
        print_json(summary)
    if verify and (reason := done.why_not_same(log)):
        raise CheckFailedError(reason)
    if strict:
        _refuse_violated(log, summary)


def leave_chain(
    scenario: Scenario,
    runs: Sequence[RunData],
    summary: dict[str, Any],
    folder: Path,
    picture: str,
    figures: Kind | None = None,
) -> None:
    """Write the summary of a chain's followers, its picture by the given name, and its report."""
    write_json(summary, folder / "summary.json")
    trajectory = driven_trajectory(runs)
    with left_out_if_missing("report.html"):
        from hil.reports.chain_report import chain_report

        page = chain_report(scenario, runs, trajectory, summary)
        write_text_aside(folder / "report.html", page)
    if trajectory is None:
        note("no picture: the log does not tell where the robots really were")
        return
    until = float(trajectory.t[-1])
    with left_out_if_missing(picture):
        from hil.figures.chain_figures import chain_paper_figures, draw_chain

        draw_chain(scenario, trajectory, until, folder / picture)
        if figures:
            from hil.figures.paper_figures import write_paper_figures

            write_paper_figures(chain_paper_figures(scenario, trajectory, until), folder / "figures", figures)


def _refuse_violated(log: Log, summary: dict[str, Any]) -> None:
    broken = [
        f"{pair['follower']}: {name} by {count}"
        for pair in summary["pairs"]
        for name, count in violated_bounds(pair).items()
    ]
    if broken:
        raise CheckFailedError(f"log {log.path}: bounds violated (samples): {', '.join(broken)}")
