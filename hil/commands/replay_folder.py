"""What ``abreast replay`` makes of a folder of logs: one table, a page, and the worst by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.commands.outputs import refuse_no_folder
from hil.commands.progress import progress
from hil.errors import AbreastError, CheckFailedError, UsageError
from hil.extras import left_out_if_missing
from hil.log.report_json import print_json, say
from hil.log.written_aside import write_text_aside
from hil.reports.judged_log import leave, made_folder, results_in

if TYPE_CHECKING:
    from hil.judge.replayed import ReplayChoice

_MOST_NAMED = 10
_REPORTS = 3
"""So many of the worst get a report of their own: one takes a few seconds."""


def replay_folder(
    folder: Path,
    choice: ReplayChoice,
    out: Path | None,
    *,
    workers: int | None,
    scheduler: str | None,
    strict: bool,
    as_json: bool,
) -> None:
    """Judge all logs in a folder; raises :class:`CheckFailedError` at the end for what was wrong with any."""
    from hil.reports.logs_report import logs_report, logs_verdict
    from hil.sweep.judged_logs import judge_logs, write_judged

    place = out or folder.absolute().with_name(f"{folder.absolute().name}-out")
    refuse_no_folder(place, "--out")
    with progress("replaying", 1.0, "logs") as tell:
        result = judge_logs(
            folder,
            choice,
            strict=strict,
            workers=workers or len(os.sched_getaffinity(0)),
            scheduler=scheduler,
            leave_out=place,
            progress=tell,
        )
    made_folder(place)
    # Before anything is drawn: hours of judging may be behind it.
    write_judged(result, place)
    if not result.get("interrupted"):
        try:
            _report_worst(result, choice, place)
        except KeyboardInterrupt:
            result["interrupted"] = True
        write_judged(result, place)
    with left_out_if_missing("report.html"):
        write_text_aside(place / "report.html", logs_report(result, place))
    for line in _lines(result, logs_verdict(result)):
        say(line)
    say(results_in(place))
    if as_json:
        print_json(result)
    if result.get("interrupted"):
        raise KeyboardInterrupt
    if result["broken"] or result["failed"]:
        wrong = [row for row in result["logs"] if "error" in row or "failed" in row]
        first = wrong[0].get("error") or wrong[0]["failed"][0]
        count = f"{len(wrong)} of {len(result['logs'])} logs"
        raise CheckFailedError(f"{count} could not be judged or failed a check; the first: {first}")


def refuse_for_folder(folder: Path, options: dict[str, object]) -> None:
    """Raise :class:`UsageError` for options that are about a single log."""
    for name, value in options.items():
        if value:
            raise UsageError(f"{name}: is for a single log, and {folder} is a folder of logs; leave it out")


def _report_worst(result: dict[str, Any], choice: ReplayChoice, place: Path) -> None:
    """Write reports of the worst logs, and note in their rows where they are."""
    from hil.commands.chain_results import leave_chain
    from hil.judge.replayed import replayed
    from hil.log.opened import opened_log

    rows = {row["log"]: row for row in result["logs"]}
    for number, worst in enumerate(result["worst"][:_REPORTS], 1):
        row = rows[worst["log"]]
        try:
            done = replayed(opened_log(Path(result["folder"]) / row["log"]), choice)
        except AbreastError:
            continue
        kept = made_folder(place / f"worst-{number}")
        if "pairs" in done.summary:
            leave_chain(done.scenario, done.runs, done.summary, kept, "replay.png")
        else:
            leave(done.runs[0], done.summary, kept, "replay.png")
        row["report"] = f"{kept.name}/report.html"


def _lines(result: dict[str, Any], verdict: str) -> list[str]:
    """What a person reads: the verdict, what is broken, and the worst with why."""
    lines = [verdict]
    broken = [f"  {row['log']}: {row['error']}" for row in result["logs"] if "error" in row]
    if broken:
        lines += ["could not be judged:", *broken[:_MOST_NAMED]]
        lines += [f"  and {len(broken) - _MOST_NAMED} more"] * (len(broken) > _MOST_NAMED)
    if result["worst"]:
        lines += ["worst:", *(f"  {each['log']}: {each['why']}" for each in result["worst"])]
    return lines
