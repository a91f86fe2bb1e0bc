"""What is left beside the log of a run or a replay: its summary, its picture and its report."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.errors import UsageError
from hil.extras import left_out_if_missing
from hil.log.report_json import write_json
from hil.log.written_aside import write_text_aside

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind
    from hil.judge.run_data import RunData
    from hil.log.reader import Log


def made_folder(folder: Path) -> Path:
    """The folder of --out, made with all above it; raises :class:`UsageError` if it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--out {folder}: cannot be made ({error.strerror}); give another folder") from None
    return folder


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder; raises :class:`UsageError` if one is going on in it."""
    held = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(f"--out {folder}: another run is going on there; give another folder") from None
        yield
    finally:
        os.close(held)


def judge_log(log: Log, folder: Path, figures: Kind | None = None) -> dict[str, Any]:
    """Summary of the log of a pair; ``summary.json``, ``run.png`` and ``report.html`` go into the folder.

    ``figures``: as :func:`leave`.
    """
    from hil.judge.run_data import run_data_of_log
    from hil.judge.summary import summarise

    run_data = run_data_of_log(log)
    summary = summarise(run_data)
    leave(run_data, summary, folder, "run.png", figures)
    return summary


def results_in(folder: Path) -> str:
    """Where results are, and what to look at first, in words."""
    report = folder / "report.html"
    return f"results in {folder}" + (f", look at {report}" if report.exists() else "")


def leave(
    run_data: RunData,
    summary: Mapping[str, Any],
    folder: Path,
    picture: str,
    figures: Kind | None = None,
) -> None:
    """Write the summary of a run's data, its picture by the given name, and its report.

    ``figures``: each figure on its own as well, of that kind, in a folder ``figures`` there. Where the extra
    is missing that draws them, the summary alone, and say so on stderr.
    """
    # All that drawing needs: a second of imports, for those who ask only.
    from hil.figures.plot_data import PlotData

    write_json(summary, folder / "summary.json")
    with left_out_if_missing(f"{picture} and no report.html"):
        from hil.figures.run_figures import draw_run, run_paper_figures
        from hil.reports.run_report import run_report

        data = PlotData.of(run_data)
        draw_run(data, summary, folder / picture)
        write_text_aside(folder / "report.html", run_report(data, summary))
        if figures:
            from hil.figures.paper_figures import write_paper_figures

            write_paper_figures(run_paper_figures(data), folder / "figures", figures)
