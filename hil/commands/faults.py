"""``abreast faults``: faults put into live runs on purpose, and whether robots stand for them."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.outputs import OutputFolder
from hil.commands.whole_numbers import Whole
from hil.errors import CheckFailedError, UsageError
from hil.log.report_json import note, print_json, print_text, results_apart

if TYPE_CHECKING:
    from hil.faults.fault import Fault
    from hil.faults.session import Session


@click.command("faults")
@click.option(
    "--only", multiple=True, metavar="NAME", help="A fault, or all that begin so; may be given again."
)
@click.option("--tries", type=Whole(1), default=1, show_default=True, metavar="N")
@click.option("--list", "as_list", is_flag=True, help="Print the names of all faults, and end.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object on stdout.")
@click.option(
    "--out",
    type=OutputFolder(),
    metavar="DIR",
    help="Folder for reliability.md, faults.json, and in wrong/ what was said in tries with something wrong.",
)
@click.option("--ros", is_flag=True, help="Drivers are reached and judged in ROS 2, by rclpy.")
@click.option("--add", is_flag=True, help="Add to the tries that the folder of --out has.")
@results_apart()
def command(
    only: tuple[str, ...],
    tries: int,
    as_list: bool,
    as_json: bool,
    out: Path | None,
    ros: bool,
    add: bool,
) -> None:
    """Kill, freeze, cut, flood and forge in live runs, and measure for how long a robot goes on.

    The robots are emulated, keep their last command for ever, and are judged from outside. A try takes some
    13 seconds. Link faults and a full disk take root. Ends with 1 where a robot is told to move for longer
    than 0.3 s after its reason, or anything is lost, hangs, is left, or ends for another reason than its
    fault. Ctrl-C leaves what was tried by then.
    """
    from hil.faults.matrix import faults
    from hil.faults.report import merged, skipped_of
    from hil.faults.ros_ear import refuse_without_ros
    from hil.faults.session import Session, Tries, tried
    from hil.live.interrupts import interrupt_on_signals

    if as_list:
        print_text("".join(f"{fault.name}\n" for fault in faults()))
        return
    chosen = _chosen(faults(), only)
    if add and out is None:
        raise UsageError("--add: adds to what is in a folder; give --out DIR with it")
    if ros:
        refuse_without_ros()
    before = _before(out, ros) if add and out is not None else Session(ros=ros)
    interrupt_on_signals(once=True)
    how = Tries(tries, _domain() if ros else None, None if out is None else out / "wrong")
    session = tried(chosen, how, note)
    session.cases = merged(before.cases, session.cases, faults())
    session.skipped = skipped_of([*before.skipped, *session.skipped], session.cases)
    _tell(session, out, as_json=as_json)
    if session.interrupted:
        raise KeyboardInterrupt
    if session.broken:
        raise CheckFailedError(session.broken)
    if any(case.failed for case in session.cases):
        sys.exit(1)


def _domain() -> int:
    """A ROS domain that is hardly anybody's."""
    return 40 + os.getpid() % 60


def _before(out: Path, ros: bool) -> Session:
    """What a folder has of before, of drivers that hear where they do now."""
    from hil.faults.matrix import faults
    from hil.faults.report import Skipped, cases_of
    from hil.faults.session import Session

    place = out / "faults.json"
    if not place.exists():
        return Session(ros=ros)
    try:
        result = json.loads(place.read_text(encoding="utf-8"))
        skipped = [Skipped(**each) for each in result["skipped"]]
        found = Session(cases_of(result, faults()), skipped, ros=result["ros"])
    except OSError as error:
        raise UsageError(f"--add: {place}: {error.strerror}; leave it out, or give another --out") from None
    except (ValueError, KeyError, TypeError):
        raise UsageError(f"--add: {place} is no result of this command; leave it out, or move it") from None
    if found.ros != ros:
        raise UsageError(
            f"--add: {place} is of drivers {'on the wire' if ros else 'in ROS'}; give another --out"
        )
    return found


def _chosen(known: tuple[Fault, ...], only: tuple[str, ...]) -> list[Fault]:
    for name in only:
        if not any(fault.name.startswith(name) for fault in known):
            raise UsageError(f"--only {name!r}: no fault begins so; abreast faults --list names all")
    return [fault for fault in known if not only or any(fault.name.startswith(name) for name in only)]


def _tell(session: Session, out: Path | None, *, as_json: bool) -> None:
    """Leave and print what came of it."""
    from hil.faults.report import as_markdown, as_result
    from hil.log.report_json import write_json
    from hil.log.written_aside import write_text_aside

    result = as_result(session.cases, session.skipped, ros=session.ros)
    page = as_markdown(session.cases, session.skipped, ros=session.ros)
    if as_json:
        print_json(result)
    else:
        print_text(page[page.index("|") :] if "|" in page else page)
    if out is None or not session.cases:
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_json(result, out / "faults.json")
        write_text_aside(out / "reliability.md", page)
    except OSError as error:
        raise UsageError(f"--out {out}: {error.strerror or error}; give another folder") from None
