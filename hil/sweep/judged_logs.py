"""A folder of logs judged in one go: a row for each, whatever is wrong with it, and the worst by name."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from hil import __version__
from hil.errors import AbreastError, UsageError
from hil.extras import left_out_if_missing
from hil.judge.dotted_figures import figures_of
from hil.judge.made_by import law_name
from hil.judge.replay_verdict import violated_bounds
from hil.judge.replayed import ReplayChoice, replayed
from hil.log.log_folder import logs_in
from hil.log.opened import opened_log
from hil.log.report_json import write_json
from hil.sweep.results import write_table
from hil.sweep.shared_work import LostWorkerError, shared_here, shared_on_cluster
from hil.sweep.worst_logs import worst_of

_NOT_REACHED = "was not judged: the replay was broken off before"


def judged_row(folder: Path, choice: ReplayChoice, strict: bool, path: Path) -> dict[str, Any]:
    """Row of a log: its ``summary``, or the ``error`` why there is none.

    ``failed``: checks that it does not pass, those of ``choice.verify`` and of ``strict``, and damage; absent
    for none. An error that nobody thought of is that of this log, too, and not the end of all others.
    """
    row: dict[str, Any] = {"log": _name(folder, path)}
    begun = time.perf_counter()
    try:
        log = opened_log(path)
        done = replayed(log, choice)
    except AbreastError as error:
        return {**row, "error": str(error)}
    except Exception as error:
        return {**row, "error": f"log {path}: {type(error).__name__}: {error}"}
    failed = [done.damage] if done.damage else []
    if choice.verify and (reason := done.why_not_same(log)):
        failed.append(reason)
    if strict:
        summaries = done.summary.get("pairs", [done.summary])
        broken = {name for each in summaries for name in violated_bounds(each)}
        failed += [f"bounds violated: {', '.join(sorted(broken))}"] if broken else []
    row |= {"summary": done.summary, "wall_s": time.perf_counter() - begun}
    return row | ({"failed": failed} if failed else {})


def judge_logs(
    folder: Path,
    choice: ReplayChoice,
    *,
    strict: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    leave_out: Path | None = None,
    progress: Callable[[int, int], None],
) -> dict[str, Any]:
    """JSON of all logs in a folder, in the order of their names, but for what is in ``leave_out``.

    ``worst``: logs that stand out, the worst first, each with why. What was not reached as a worker died, or
    as somebody pressed Ctrl-C, has that for an error; ``interrupted`` tells of the latter. ``progress`` is
    told how many are done, of how many.
    """
    begun = time.perf_counter()
    folder = folder.absolute()  # workers may stand elsewhere
    logs = [
        each for each in logs_in(folder) if leave_out is None or not each.is_relative_to(leave_out.absolute())
    ]
    if not logs:
        raise UsageError(f"log {folder}: holds no logs; give a log, or a folder with some")
    rows: dict[Path, dict[str, Any]] = {}
    interrupted = False
    progress(0, len(logs))
    task = partial(judged_row, folder, choice, strict)
    try:
        if scheduler is None:
            work = shared_here(task, logs, workers)
        else:
            once = uuid.uuid4().hex
            work = shared_on_cluster(task, logs, scheduler, lambda path: f"{once}-{path}")
        for path, row in work:
            rows[path] = row
            progress(len(rows), len(logs))
    except LostWorkerError as error:
        lost = f"was not judged: {error}"
        rows |= {path: {"log": _name(folder, path), "error": lost} for path in logs if path not in rows}
    except KeyboardInterrupt:
        interrupted = True
    found = [rows.get(path, {"log": _name(folder, path), "error": _NOT_REACHED}) for path in logs]
    judged = [row for row in found if "summary" in row]
    return {
        "folder": str(folder),
        "version": __version__,
        "choice": {name: value for name, value in asdict(choice).items() if value},
        "judged": len(judged),
        "broken": len(found) - len(judged),
        "failed": sum("failed" in row for row in found),
        **({"interrupted": True} if interrupted else {}),
        "worst": worst_of(found),
        "logs": found,
        "wall_s": time.perf_counter() - begun,
    }


def write_judged(result: Mapping[str, Any], folder: Path) -> None:
    """Write ``results.json`` and ``results.parquet``, a row for each log with its figures.

    The latter is left out where its extra is missing, and that is said on stderr.
    """
    write_json(result, folder / "results.json")
    with left_out_if_missing("results.parquet"):
        write_table([_flat_row(row) for row in result["logs"]], folder / "results.parquet")


def _flat_row(row: Mapping[str, Any]) -> dict[str, Any]:
    summary = row.get("summary", {})
    findings = [str(each["name"]) for each in summary.get("findings", [])]
    return {
        "log": row["log"],
        "error": row.get("error"),
        "failed": "; ".join(row.get("failed", [])) or None,
        "findings.names": ", ".join(findings) or None,
        **{name: summary.get(name) for name in ("scenario", "mode", "estimator")},
        "law": law_name(summary["law"]) if "law" in summary else None,
        **{name: value for name, value in figures_of(summary).items() if "certificate." not in name},
    }


def _name(folder: Path, path: Path) -> str:
    return os.path.relpath(path, folder)
