"""The verdict on a long run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.soak.memory import Sample, growth_mb_h
from hil.soak.verified_log import Verification
from hil.soak.watched_run import WatchedRun

GROWTH_MB_H = 1.0
"""What a process may grow by in an hour [MB]."""

LATE_SHARE = 1e-4
"""Of all cycles so many may be late."""


def as_result(scenario: str, run: WatchedRun, verified: Verification | None) -> dict[str, Any]:
    """JSON of ``abreast soak``; ``failed``: what is wrong, in words, empty for nothing.

    ``verified``: None where there is no log that could be.
    """
    cycles = _cycles(run.summary)
    found = {each["name"] for part in _parts(run.summary) for each in part.get("findings", ())}
    processes = [_process(name, samples) for name, samples in sorted(run.memory.items())]
    return {
        "scenario": scenario,
        "duration_s": run.summary.get("duration_s"),
        "exit": run.code,
        "processes": processes,
        "cycles": cycles,
        "verify": None if verified is None else {"compared": verified.compared, "differ": verified.differ},
        "findings": sorted(found),
        "failed": list(_failures(run, processes, cycles, verified)),
    }


def _parts(summary: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The verdicts on the pairs of a run: of a chain one for each follower."""
    parts: list[Mapping[str, Any]] = summary.get("pairs", [summary] if summary else [])
    return parts


def _cycles(summary: Mapping[str, Any]) -> dict[str, Any]:
    """All cycles of all followers together."""
    each = [part["cycles"] for part in _parts(summary) if part.get("cycles")]
    if not each:
        return {}
    return {
        "count": sum(part["count"] for part in each),
        "late": sum(part["late"] for part in each),
        "limit_ms": max(part["limit_ms"] for part in each),
        "longest_ms": max(part["longest_ms"] for part in each),
    }


def _process(name: str, samples: list[Sample]) -> dict[str, Any]:
    return {
        "name": name,
        "samples": len(samples),
        "memory_mb": round(samples[-1].mb, 3),
        "peak_mb": round(max(each.mb for each in samples), 3),
        "growth_mb_h": growth_mb_h(samples),
    }


def _failures(
    run: WatchedRun, processes: list[dict[str, Any]], cycles: dict[str, Any], verified: Verification | None
) -> list[str]:
    failed = []
    if run.code and not run.interrupted:
        failed.append(f"the run ended with exit code {run.code}: {run.said}")
    for each in processes:
        growth = each["growth_mb_h"]
        if growth is not None and growth > GROWTH_MB_H:
            failed.append(
                f"{each['name']} grows by {growth:.2f} MB an hour, expected {GROWTH_MB_H:g} at most"
            )
    if not cycles:
        failed.append("there are no cycles to judge")
    elif cycles["late"] > LATE_SHARE * cycles["count"]:
        failed.append(
            f"{cycles['late']} of {cycles['count']} cycles were late, expected {LATE_SHARE:g} of them at most"
        )
    if verified is None:
        failed.append("there is no log to verify")
    elif verified.differ:
        failed.append(f"{verified.differ} of {verified.compared} outputs differ in a replay of the log")
    elif verified.code:
        failed.append(f"a replay of the log ended with exit code {verified.code}: {verified.said}")
    return failed
