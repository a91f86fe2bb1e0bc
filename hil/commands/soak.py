"""``abreast soak``: a long live run, and whether memory stays flat, cycles on time, and its log repeats."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from hil.commands.outputs import OutputFolder, new_folder
from hil.commands.seconds import Seconds
from hil.errors import CheckFailedError, UsageError
from hil.live.interrupts import interrupt_on_signals
from hil.log.report_json import note, print_json, print_text, results_apart, write_json
from hil.scenario.files import load_scenario, refuse_unrunnable

_HOUR_S = 3600.0
_TOLD_EACH_S = 60.0


@click.command("soak")
@click.argument("scenario", default="turtlebot3")
@click.option(
    "--duration", type=Seconds(1.0), default=_HOUR_S, show_default=True, metavar="S", help="Seconds to drive."
)
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override any key of the scenario."
)
@click.option("--apart", is_flag=True, help="Estimator and controller as two processes.")
@click.option("--out", type=OutputFolder(), metavar="DIR", help="Folder for results.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object on stdout.")
@results_apart()
def command(
    scenario: str, duration: float, overrides: tuple[str, ...], apart: bool, out: Path | None, as_json: bool
) -> None:
    """Drive SCENARIO live for an hour with emulated robots, and watch what runs.

    Ends with 1 where the run does not end well, a process grows by more than 1 MB an hour after its first
    five minutes (told from 15 minutes on), more than one of 10,000 cycles is late by a period of the motion
    capture, or a replay of the log differs.
    """
    from hil.log.rotating_log import log_place
    from hil.soak.verdict import as_result
    from hil.soak.verified_log import verified_log
    from hil.soak.watched_run import watched_run

    # What is wrong with it is said at once.
    chosen = load_scenario(scenario, overrides)
    refuse_unrunnable(chosen)
    folder = (out or new_folder(f"soak-{chosen.name}")).absolute()
    log = log_place(folder / "run.mcap", chosen.recorder)
    for there in (log, folder / "soak.json"):
        if there.exists():
            raise UsageError(f"--out {folder}: has a {there.name} already; give another folder")
    interrupt_on_signals()
    arguments = [scenario, "--duration", repr(duration), *(["--apart"] if apart else [])]
    for override in overrides:
        arguments += ["--set", override]
    run = watched_run(arguments, folder, _Progress(duration).say)
    if run.code == UsageError.exit_code:
        raise UsageError(run.said.removeprefix("abreast: "))
    result = as_result(chosen.name, run, None if run.interrupted else verified_log(log))
    if folder.is_dir():
        write_json(result, folder / "soak.json")
    if as_json:
        print_json(result)
    else:
        print_text("".join(f"{line}\n" for line in _lines(result)))
    if run.interrupted:
        raise KeyboardInterrupt
    if result["failed"]:
        raise CheckFailedError("; ".join(result["failed"]))


class _Progress:
    """Tells once a minute how far it is."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s, self._said_s = duration_s, time.monotonic()

    def say(self, at_s: float, held: str) -> None:
        if (now_s := time.monotonic()) - self._said_s >= _TOLD_EACH_S:
            self._said_s = now_s
            note(f"{at_s:5.0f} / {self._duration_s:.0f} s: {held}")


def _lines(result: dict[str, Any]) -> list[str]:
    lines = [f"{result['scenario']}, {result.get('duration_s') or 0.0:.0f} s driven"]
    for each in result["processes"]:
        growth = each["growth_mb_h"]
        told = "too short a time to tell growth" if growth is None else f"{growth:+.2f} MB/h"
        lines.append(f"  {each['name']:24} {each['memory_mb']:7.1f} MB  {told}")
    if cycles := result["cycles"]:
        lines.append(
            f"  cycles {cycles['count']}, {cycles['late']} later than {cycles['limit_ms']:.1f} ms, "
            f"the longest {cycles['longest_ms']:.1f} ms"
        )
    if result["findings"]:
        lines.append(f"  findings: {', '.join(result['findings'])}")
    if verify := result["verify"]:
        lines.append(f"  replay: {verify['compared']} compared, {verify['differ']} differ")
    return lines
