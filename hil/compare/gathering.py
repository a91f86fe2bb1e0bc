"""From what was named on the command line to groups: runs, logs, folders of many, and sweeps."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hil.compare.group import RUNS, STOPPED, SWEEP, Group, Sample
from hil.compare.metrics import metrics_of
from hil.errors import AbreastError, UsageError
from hil.extensions.reference import is_reference, short
from hil.judge.made_by import law_name
from hil.log.bag_folder import in_order
from hil.log.description import RECORD
from hil.log.log_folder import logs_in
from hil.log.opened import opened_log
from hil.log.reader import Log
from hil.log.report_json import flat
from hil.reports.sweep_cells import estimators_of, is_known, point_of

_NO_FACTS = ("grid", "description", "set")
_EXPECTED = (
    "expected the folder of a run (summary.json), of a sweep or of judged logs (results.json), of many "
    "of these, or a log"
)


def groups_of(paths: Sequence[Path]) -> list[Group]:
    """Groups of what was named, each under the shortest name that tells it from the others.

    Raises :class:`UsageError` for what cannot be compared, with itself or with the others.
    """
    groups = [_group(path, label) for path, label in zip(paths, labels_of(paths), strict=True)]
    for group in groups[1:]:
        if group.kind != groups[0].kind:
            raise UsageError(
                f"{group.path} holds {group.kind} and {groups[0].path} {groups[0].kind}; "
                "runs are compared with runs, sweeps with sweeps"
            )
    return _matched(groups) if groups[0].kind == SWEEP else groups


def _matched(sweeps: Sequence[Group]) -> list[Group]:
    """Sweeps with only those cells that all of them have, and what all of them know of a cell."""
    by_key = [{sample.key: sample for sample in sweep.samples} for sweep in sweeps]
    shared = [key for key in by_key[0] if all(key in cells for cells in by_key[1:])]
    if not shared:
        raise UsageError(
            f"{sweeps[1].path} has no cell in common with {sweeps[0].path}: their noise, latency, loss or "
            "estimators differ; sweep the same grid"
        )
    known = {key: set.intersection(*(set(cells[key].metrics) for cells in by_key)) for key in shared}
    return [
        replace(
            sweep,
            samples=tuple(
                replace(
                    cells[key],
                    metrics={name: cells[key].metrics[name] for name in sorted(known[key])},
                    lost=frozenset(cells[key].metrics) - known[key],
                )
                for key in shared
            ),
        )
        for sweep, cells in zip(sweeps, by_key, strict=True)
    ]


def labels_of(paths: Sequence[Path]) -> list[str]:
    """Last parts of paths, as few as tell them apart."""
    parts = [Path(os.path.normpath(path.absolute())).parts for path in paths]
    for count in range(1, max(map(len, parts)) + 1):
        labels = ["/".join(each[-count:]) for each in parts]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{each[-1]} ({n})" for n, each in enumerate(parts, 1)]


def _group(path: Path, label: str) -> Group:
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder; {_EXPECTED}")
    if path.is_dir() and (path / "results.json").is_file():
        return _of_results(path, path / "results.json", label)
    if path.suffix == ".json":
        tree = _json(path)
        if "cells" in tree or "logs" in tree:
            return _of_results(path, path, label)
        return Group(label, path, RUNS, (_of_summary(path.parent, tree, label),), {})
    samples = tuple(_runs(path))
    if not samples:
        raise UsageError(f"{path}: holds nothing to compare; {_EXPECTED}")
    return Group(label, path, RUNS, samples, {})


def _of_results(path: Path, file: Path, label: str) -> Group:
    """A sweep, or logs that were judged in one go."""
    tree = _json(file)
    if "logs" in tree:
        logs = tree["logs"]
        if not any("summary" in each for each in logs):
            raise UsageError(f"{path}: none of its logs could be judged; nothing to compare")
        root = Path(str(tree.get("folder", "")))
        samples = [_judged(root, each) for each in logs]
        failed = sum(bool(each.get("failed")) for each in logs)
        notes = [f"of {label} {failed} of {len(logs)} runs failed a check"] * bool(failed)
        return Group(label, path, RUNS, tuple(samples), {}, (*notes, *_interrupted(tree, label)))
    cells: Sequence[Mapping[str, Any]] = tree.get("cells", [])
    if not cells:
        raise UsageError(f"{path}: its results.json has no cells; nothing to compare")
    spec = {key: value for key, value in tree.get("spec", {}).items() if key not in _NO_FACTS}
    told = flat({**spec, "version": tree.get("version")})
    facts = {key: _text(value) for key, value in told if value is not None}
    for override in tree.get("spec", {}).get("set", ()):
        key, _, value = str(override).partition("=")
        facts[key] = short(value) if key == "controller.law" and is_reference(value) else value
    asked, _ = estimators_of(cells)
    samples = [
        _cell(number, cell, facts, len(asked) == 1)
        for number, cell in enumerate(cells)
        if str(cell["estimator"]) in asked
    ]
    return Group(label, path, SWEEP, tuple(samples), tree, _interrupted(tree, label))


def _interrupted(tree: Mapping[str, Any], label: str) -> tuple[str, ...]:
    return (f"{label} was interrupted, so that it lacks runs",) if tree.get("interrupted") else ()


def _cell(number: int, cell: Mapping[str, Any], facts: Mapping[str, str], alone: bool) -> Sample:
    """A cell; of a single estimator it is the same whichever that is."""
    key = point_of(cell) if alone else f"{cell['estimator']} at {point_of(cell)}"
    metrics = metrics_of(cell) if is_known(cell) else {"diverged": float(cell["diverged"])}
    return Sample(
        f"cell {number}", key, metrics, facts, runs=int(cell["runs"]), noise=cell.get("sigma_position")
    )


def _judged(root: Path, each: Mapping[str, Any]) -> Sample:
    """A judged log; without any metric where it could not be judged."""
    name = str(each["log"])
    log, summary = root / name, each.get("summary")
    if summary is None:
        return Sample(name, name, {}, {})
    return Sample(name, name, metrics_of(summary), _facts(log, summary), _there(log))


def _runs(path: Path) -> Iterator[Sample]:
    """Runs in a folder and the folders in it; logs beside no summary are judged as they were recorded."""
    if path.is_file():
        yield _of_log(path, path.name)
        return
    for folder in _run_folders(path):
        name = str(folder.relative_to(path))
        if (summary := folder / "summary.json").is_file():
            yield _of_summary(folder, _json(summary), name)
            continue
        for log in logs_in(folder):
            above = (each for each in log.parents if each.is_relative_to(path))
            if not any((each / "summary.json").is_file() for each in above):
                yield _of_log(log, str(log.relative_to(path)) if log != path else path.name)


def _run_folders(path: Path) -> list[Path]:
    """The folder itself where that is a run, else those of runs below, and it for the logs that are left."""
    if (path / "summary.json").is_file():
        return [path]
    below = sorted((each.parent for each in path.rglob("summary.json")), key=in_order)
    return [*below, path]


def _of_summary(folder: Path, summary: Mapping[str, Any], name: str) -> Sample:
    if not ("estimation" in summary or "pairs" in summary):
        raise UsageError(f"{folder}/summary.json: is no summary of a run or a replay; {_EXPECTED}")
    told = Path(str(summary.get("log", {}).get("path", "")))
    log = _there(folder / "run.mcap") or _there(folder / "run") or _there(told)
    table = folder / "estimates.csv" if summary.get("mode") == "replay" else None
    return Sample(name, _seed(summary), metrics_of(summary), _facts(log, summary), log, _there(table))


def _of_log(path: Path, name: str) -> Sample:
    """A log as it was recorded; replayed where it has no estimates of its own."""
    from hil.judge.chain_summary import summarise_chain
    from hil.judge.replayed import ReplayChoice, replayed
    from hil.judge.run_data import run_data_of_link, run_data_of_log
    from hil.judge.summary import summarise
    from hil.log.metadata import scenario_of
    from hil.scenario.links import chain_of, links_of
    from hil.wire.topics import link_topics

    log = opened_log(path)
    scenario = scenario_of(log)
    if scenario is None or not any(log.counts.get(link_topics(link).estimate) for link in links_of(scenario)):
        try:
            summary = replayed(log, ReplayChoice()).summary
        except AbreastError as error:
            raise UsageError(f"{error}; or judge it by abreast replay --out DIR, and compare that") from None
    elif chain_of(scenario) is None:
        summary = summarise(run_data_of_log(log))
    else:
        summary = summarise_chain(scenario, [run_data_of_link(log, link) for link in links_of(scenario)])
    return Sample(name, _seed(summary), metrics_of(summary), _facts(path, summary), path)


def _seed(summary: Mapping[str, Any]) -> str:
    return f"{summary['scenario']}, seed {summary['seed']}" if "seed" in summary else ""


def _facts(log: Path | None, summary: Mapping[str, Any]) -> dict[str, str]:
    """Conditions of a run: those of its log, and what its summary says otherwise."""
    told = {} if log is None else _record_of(log)
    facts = {}
    if "scenario_toml" in told:
        facts = {key: _text(value) for key, value in flat(tomllib.loads(told["scenario_toml"]))}
    others = {
        "scenario": summary.get("scenario"),
        "run.seed": summary.get("seed"),
        "mode": summary.get("mode"),
        "version": told.get("version"),
        "estimator.kind": summary.get("estimator"),
        "controller.law": law_name(summary["law"]) if "law" in summary else None,
        STOPPED: (summary.get("stopped_by") or {}).get("reason"),
    }
    if isinstance(law := summary.get("law"), Mapping):
        others["controller.law (digest)"] = law.get("digest")
    facts |= {key: _text(value) for key, value in others.items() if value is not None}
    return {key: text for key, text in facts.items() if key not in ("name", "description")}


def _record_of(log: Path) -> Mapping[str, str]:
    try:
        opened: Log = opened_log(log)
    except UsageError:
        return {}
    return opened.metadata.get(RECORD, {})


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True, default=str)


def _there(path: Path | None) -> Path | None:
    return path if path is not None and path.exists() and path != Path() else None


def _json(path: Path) -> dict[str, Any]:
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: cannot be read as JSON ({error}); run what made it again") from None
    if not isinstance(tree, dict):
        raise UsageError(f"{path}: holds no object; {_EXPECTED}")
    return tree
