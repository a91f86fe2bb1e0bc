"""``abreast faults``: faults put into live runs on purpose, and whether robots stand for them."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import click

from hil.errors import UsageError
from hil.log.report_json import print_json, print_text, results_apart

if TYPE_CHECKING:
    from hil.faults.fault import Fault


@click.command("faults")
@click.option(
    "--only", multiple=True, metavar="NAME", help="A fault, or all that begin so; may be given again."
)
@click.option("--tries", type=click.IntRange(min=1), default=1, show_default=True, metavar="N")
@click.option("--list", "as_list", is_flag=True, help="Print the names of all faults, and end.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object on stdout.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder for reliability.md and faults.json.",
)
@results_apart()
def command(only: tuple[str, ...], tries: int, as_list: bool, as_json: bool, out: Path | None) -> None:
    """Kill, freeze, cut, flood and forge in live runs, and measure for how long a robot goes on.

    The robots are emulated, keep their last command for ever, and are judged from outside. A try takes some
    15 seconds. Link faults and a full disk take root. Ends with 1 where a robot is told to move for longer
    than 0.3 s after its reason, or anything is lost, hangs, is left, or ends for another reason than its
    fault.
    """
    from hil.faults.matrix import faults

    if as_list:
        print_text("".join(f"{fault.name}\n" for fault in faults()))
        return
    _try_all(_chosen(faults(), only), tries, as_json=as_json, out=out)


def _chosen(known: tuple[Fault, ...], only: tuple[str, ...]) -> list[Fault]:
    for name in only:
        if not any(fault.name.startswith(name) for fault in known):
            raise UsageError(f"--only {name!r}: no fault begins so; abreast faults --list names all")
    return [fault for fault in known if not only or any(fault.name.startswith(name) for name in only)]


def _try_all(chosen: list[Fault], tries: int, *, as_json: bool, out: Path | None) -> None:
    from hil.faults.report import as_markdown, as_result
    from hil.faults.session import tried
    from hil.log.report_json import write_json
    from hil.log.written_aside import write_text_aside

    def leave(_number: int, _frame: FrameType | None) -> None:
        # Else what was started and mounted would stay.
        raise KeyboardInterrupt

    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, leave)
    session = tried(chosen, tries, lambda line: click.echo(line, err=True))
    result = as_result(session.cases, session.skipped)
    page = as_markdown(session.cases, session.skipped)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
            write_json(result, out / "faults.json")
            write_text_aside(out / "reliability.md", page)
        except OSError as error:
            raise UsageError(f"--out {out}: {error.strerror or error}; give another folder") from None
    if as_json:
        print_json(result)
    else:
        print_text(page[page.index("|") :] if "|" in page else page)
    if session.interrupted:
        raise KeyboardInterrupt
    if any(case.failed for case in session.cases):
        sys.exit(1)
