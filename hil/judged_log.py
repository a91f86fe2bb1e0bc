"""What is left beside the log of a run: its summary, its picture and its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.log.reader import Log
from hil.report_json import write_json


def judge_log(log: Log, folder: Path) -> dict[str, Any]:
    """Summary of the log of a pair; ``summary.json``, ``run.png`` and ``report.html`` go into the folder."""
    # All that judging and drawing need: a second of imports, for those who ask only.
    from hil.figures.run_figures import draw_run
    from hil.figures.shown import Shown
    from hil.judge.evidence import evidence_of_log
    from hil.judge.summary import summarise
    from hil.reports.run_report import run_report

    evidence = evidence_of_log(log)
    summary = summarise(evidence)
    write_json(summary, folder / "summary.json")
    shown = Shown.of(evidence)
    draw_run(shown, summary, folder / "run.png")
    (folder / "report.html").write_text(run_report(shown, summary), encoding="utf-8")
    return summary
