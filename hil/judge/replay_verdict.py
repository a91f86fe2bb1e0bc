"""What a replay is judged by, and whether it passes the checks that were asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any

import numpy as np

from hil import __version__
from hil.errors import UsageError
from hil.judge.certified import certified_violations
from hil.judge.findings import found_again
from hil.judge.late_recorder import late_recorder
from hil.judge.run_data import (
    RunData,
    captured,
    own_certificate,
    run_data_of_kept,
    run_data_of_link,
    run_data_of_log,
)
from hil.log.metadata import IMPORT, cut_in_front_s, mode_of, version_of
from hil.log.reader import Log
from hil.log.report_json import note
from hil.replay.kept import Array, KeptReplay
from hil.replay.re_execution import Parity
from hil.replay.rerun import Replay
from hil.scenario.certify import same_steps
from hil.scenario.schema import Scenario
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import to_ns

Played = Replay | KeptReplay
"""A replay of one follower, in messages or in rows."""

_LONG_GAP_S = 0.5
_CALLED = {"certified": "certified estimates"}


def refuse_other_steps(chosen: Scenario, own: Scenario) -> None:
    """Raise :class:`UsageError` where --verify cannot compare: other settings make other estimates."""
    if not same_steps(chosen, own):
        raise UsageError(
            "--verify compares with what was recorded, with the log's own settings; leave out what changes "
            "them"
        )


def run_data_of_replay(
    log: Log, played: Played, from_s: float | None = None, to_s: float | None = None
) -> RunData:
    """Run data of a log with the estimates, commands and counts of its replay in place of the recorded ones.

    ``from_s``, ``to_s`` [s] limit the evaluation: in an imported log in the source's own time, else from when
    an emulated leader set off, else from the first capture. Raises :class:`UsageError` if they leave no
    estimate.
    """
    found = _run_data(log, played)
    estimates = captured(found, truth=False)
    zero_ns = found.zero_ns
    if found.motion_since_ns is None and mode_of(log) != IMPORT and estimates is not None:
        zero_ns = estimates.from_ns
    run_data = replace(
        found,
        mode="replay",
        # Those of the log's own estimator: another one refuses other inputs.
        troubles=found.troubles if played.parity else (),
        zero_ns=zero_ns,
        evaluate_from_ns=None if from_s is None else zero_ns + round(from_s * 1e9),
        evaluate_to_ns=None if to_s is None else zero_ns + round(to_s * 1e9),
    )
    if estimates is not None and not len(evaluated(run_data)):
        first_s, last_s = ((at - zero_ns) * 1e-9 for at in (estimates.from_ns, estimates.to_ns))
        raise UsageError(
            f"log {log.path}: no estimate between --from and --to; there are some from {first_s:.3f} s "
            f"to {last_s:.3f} s"
        )
    return run_data


def _run_data(log: Log, played: Played) -> RunData:
    link = played.link
    if isinstance(played, KeptReplay):
        found = run_data_of_kept(log, played)
        found = replace(found, found=found_again(found.found, played.found, link, same=bool(played.parity)))
        return found if link.in_chain else replace(found, certificate=own_certificate(log, link.scenario))
    found = run_data_of_link(log, link) if link.in_chain else run_data_of_log(log, link.scenario)
    return replace(
        found,
        estimates=played.estimates,
        commands=played.commands,
        certified=played.certified,
        taken=played.estimator.taken,
        refused=played.estimator.refused,
        noise_scale=played.estimator.noise_scale,
        found=found_again(found.found, played.found, link, same=bool(played.parity)),
    )


def evaluated(run_data: RunData) -> Sequence[LeaderEstimate] | Array:
    """Estimates within the limits that were asked for, both ends included; all if there are none.

    Rows of :class:`hil.replay.kept_rows.EstimateRow` where the run data has these.
    """
    first, last, kept = run_data.evaluate_from_ns, run_data.evaluate_to_ns, run_data.kept
    if kept is None:
        captures_ns = np.array([to_ns(each.header.stamp) for each in run_data.estimates], dtype=np.int64)
    else:
        captures_ns = kept.estimates["capture_ns"]
    there = np.ones(len(captures_ns), dtype=np.bool_)
    if first is not None:
        there &= captures_ns >= first
    if last is not None:
        there &= captures_ns <= last
    if kept is not None:
        return kept.estimates[there]
    return list(compress(run_data.estimates, there))


def parity_json(*played: Played) -> dict[str, Any]:
    """Counts of the comparison as the summary has them, over all followers that were replayed."""
    nothing = Parity(0, 0)
    names = ["estimates", "commands"] + ["certified"] * any("certified" in each.parity for each in played)
    counts = {name: [each.parity.get(name, nothing) for each in played] for name in names}
    return {
        name: {
            "compared": sum(parity.compared for parity in parities),
            "mismatched": sum(parity.mismatched for parity in parities),
        }
        for name, parities in counts.items()
    }


def fed_json(played: Played) -> dict[str, Any]:
    """Part of a summary that says why inputs were fed in log order; empty where they were not."""
    return {"fed": {"why": played.fed}} if played.fed else {}


def print_fed(log: Log, *played: Played) -> None:
    """Say on stderr why inputs were fed in log order, a line for every follower for which they were."""
    for each in played:
        if each.fed:
            whose = f" of {each.link.follower}" if each.link.in_chain else ""
            note(f"log {log.path}: its inputs{whose} are fed in log order: {each.fed}")


def why_not_same(log: Log, played: Played) -> str:
    """What speaks against a replay that repeats the log bit for bit; empty if nothing does."""
    whose = f" of {played.link.follower}" if played.link.in_chain else ""
    if played.fed:
        return f"log {log.path}: nothing to verify{whose}: {played.fed}"
    compared = sum(parity.compared for parity in played.parity.values())
    if not compared:
        return f"log {log.path}: holds no estimates{whose}, so there is nothing to verify"
    wrong = [
        f"{parity.mismatched} of {parity.compared} {_CALLED.get(name, name)}{whose} differ "
        f"(the first is number {parity.first + 1})"
        for name, parity in played.parity.items()
        if parity.first is not None
    ]
    if not wrong:
        return ""
    lost = f"{played.missing_inputs} inputs are missing in the log" if played.missing_inputs else ""
    gap_s = max(parity.gap_s for parity in played.parity.values())
    if gap_s > _LONG_GAP_S:
        # Whatever was consumed in the meantime, its receipts went by too.
        lost = lost or f"the log has nothing of {gap_s:.1f} s before: nobody can repeat what it misses"
    cut = _cut_in_front(log)
    begins = not cut and any(parity.first == 0 for parity in played.parity.values())
    late = late_recorder(log, played.link) if begins else ""
    reasons = [reason for reason in (late or lost, cut, _other_version(log)) if reason]
    question = "did every daemon run with the recorder's scenario, and with this version of abreast?"
    return f"log {log.path}: {', '.join(wrong)}; {'; '.join(reasons) or question}"


def _cut_in_front(log: Log) -> str:
    """That a log lacks its beginning; empty if it does not, or does not say."""
    missing_s = cut_in_front_s(log)
    if not missing_s:
        return ""
    return (
        f"its first {missing_s:.1f} s were cut off, and nobody can repeat what rests on them; verify the "
        "log that begins with the run"
    )


def _other_version(log: Log) -> str:
    """That a log was written by another version than this one; empty if it was not, or does not say."""
    version = version_of(log)
    if version is None or version == __version__:
        return ""
    return (
        f"it was written by abreast {version} and this is {__version__}, which may calculate otherwise; "
        f"verify it with abreast {version}"
    )


def violated_bounds(summary: Mapping[str, Any]) -> dict[str, int]:
    """Extended bounds and certified radii that samples lie outside of, with how many do."""
    violations = summary.get("bounds", {}).get("violations", {})
    broken = {name: count for name, count in violations.items() if name.endswith("_extended") and count}
    return broken | certified_violations(summary)
