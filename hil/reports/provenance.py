"""How a run was made, by what its log tells: versions, host, date, scenario, and how to do it again."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from hil.errors import UsageError
from hil.judge.made_by import made_by
from hil.judge.run_data import RunData
from hil.judge.summary_text import judged_by
from hil.log.metadata import IMPORT, LIVE
from hil.log.older_keys import with_older_keys
from hil.log.origin import Origin
from hil.scenario.files import build_scenario, changes_from_shipped

_OPTIONS = {
    "run.seed": "--seed",
    "run.duration_s": "--duration",
    "estimator.kind": "--estimator",
    "controller.law": "--law",
}
_BY_THE_MODE = ("guard.present", "source.emulated", "name", "description")
"""What no option of a run says: its mode does."""


def provenance_html(run_data: RunData, summary: Mapping[str, Any]) -> str:
    """Facts, commands, and the whole scenario; what the log does not tell is left out."""
    origin = run_data.origin
    facts = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in _facts(run_data, summary))
    commands = list(_commands(run_data))
    again = "".join(f"<li><code>{escape(command)}</code> {escape(does)}</li>" for command, does in commands)
    repeat = f'<h3 class="table">Once more</h3>\n<ul>{again}</ul>\n' if again else ""
    scenario = origin.scenario_toml
    whole = f"<pre>{escape(scenario)}</pre>"
    folded = f"<details><summary>The whole scenario</summary>{whole}</details>" if scenario else ""
    return f"<dl>{facts}</dl>\n{repeat}{folded}"


def _facts(run_data: RunData, summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    origin = run_data.origin
    what = [f"scenario {summary['scenario']}" if summary["scenario"] else "a recording", *made_by(summary)]
    if "seed" in summary:
        what.append(f"seed {summary['seed']}")
    yield "what", ", ".join([*what, str(summary["mode"]), f"{summary['duration_s']:.1f} s"])
    if judged := judged_by(summary):
        yield "judged", judged.partition(",")[0]
    told = {
        "abreast": origin.version,
        "begun": origin.begun,
        "host": ", ".join(filter(None, [origin.host, origin.system])),
        "Python": ", ".join(filter(None, [origin.python, origin.packages])),
    }
    yield from ((name, text) for name, text in told.items() if text)
    if origin.mode and not origin.host:
        why = "a simulated clock; the same seed gives the same log on any host"
        yield "made", f"{origin.mode}: {why}" if origin.mode == "lockstep" else origin.mode
    if run_data.log is not None:
        log = run_data.log
        yield "log", f"{log.path} ({log.messages} messages, {log.bytes / 1e6:.1f} MB)"


def _commands(run_data: RunData) -> Iterator[tuple[str, str]]:
    """Commands that make the run, or its replay, anew."""
    origin = run_data.origin
    driven = origin.mode not in ("", IMPORT)
    if driven and run_data.tracks is None and (again := _run(origin)):
        same = origin.mode != LIVE
        yield f"abreast run {again}", "gives the same log" if same else "drives it again, with other timing"
    if origin.mode and run_data.log is not None:
        log = shlex.quote(run_data.log.path)
        if driven:
            yield f"abreast replay {log} --verify", "makes every estimate and command anew and compares bytes"
        yield f"abreast replay {log} --out DIR", "makes this report anew"


def _run(origin: Origin) -> str:
    """What follows ``abreast run`` to do it again; empty if the log does not tell."""
    try:
        scenario = build_scenario(with_older_keys(tomllib.loads(origin.scenario_toml)))
    except (tomllib.TOMLDecodeError, UsageError):
        return ""
    changes = changes_from_shipped(scenario)
    name = "scenario.toml" if changes is None else scenario.name
    words = [name, "--seed", str(scenario.run.seed), *_options(changes or {})]
    if origin.mode != LIVE:
        words.append("--lockstep")
    return shlex.join(words)


def _options(changes: Mapping[str, str]) -> Iterator[str]:
    for key, value in changes.items():
        if key in _OPTIONS:
            if key != "run.seed":
                yield from (_OPTIONS[key], value.strip('"'))
        elif key == "estimator.certify" and value == "true":
            yield "--certify"
        elif key not in _BY_THE_MODE:
            yield from ("--set", f"{key}={value}")
