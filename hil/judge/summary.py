"""The verdict on a run: from run data to the JSON of ``run`` and ``replay``."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.extensions.reference import short
from hil.judge.assumptions import judge_assumptions
from hil.judge.bad_spells import bad_spells
from hil.judge.bounds import judge_bounds
from hil.judge.certified import judge_certified
from hil.judge.clock import arrival_rows, judge_clock
from hil.judge.columns import Columns, columns_of
from hil.judge.consistency import judged_findings
from hil.judge.cycles import judge_cycles
from hil.judge.estimation import judge_estimation
from hil.judge.findings import findings_list
from hil.judge.formation import judge_formation
from hil.judge.made_by import law_json
from hil.judge.noise import certain, judge_noise, refuted, supported
from hil.judge.published_bounds import judge_published
from hil.judge.run_data import RunData
from hil.log.report_json import known
from hil.nodes.stopping import stopped_by
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.ordered_sides import refusal

_STRANGERS = "unknown_body"
PERCENTILES = {"p50": 50.0, "p99": 99.0, "max": 100.0}


def summarise(run_data: RunData) -> dict[str, Any]:
    """JSON of ``run`` and ``replay`` without ``parity``; what cannot be known is absent.

    Estimates are judged where they say TRACKING, from ``estimation.evaluated_from_s`` to the stop or the end
    of the scenario's duration. ``estimation.untracked``: estimates in that time that said anything else.
    ``frames.rejected``: inputs that were refused, the robots' odometry included; frames that also held
    strangers do not count. ``commands``: those from when the leader set off to the stop; ``stopped`` of them
    told the robot to stand still, which counts from its first drive on. ``seed`` and ``law``
    are absent for recordings that were not driven by them. ``truth``: mocap where the smoothed tracks of the
    motion capture stand in for it, absent where it is known or nothing stands in. ``certified``: only where
    estimates are certified.
    ``law``: a name, of one's own more (:func:`hil.judge.made_by.law_json`).
    ``stopped_by``: who stopped the run before its time, and why; absent where nobody did.
    ``spells``: when something was bad, and why (:mod:`hil.judge.bad_spells`).
    ``findings``: what nodes found to be wrong, and the judge (:mod:`hil.judge.findings`); absent where nobody
    could have told. ``orders_refused``: why the scenario's own orders to change sides were, if they were.
    ``window``: when alone estimates, bounds, formation and spells are judged, where that was asked for.
    ``certificate``: what was guaranteed beforehand, as ``abreast bounds`` prints it, and ``certified`` hold
    no figures where ``noise`` says that the noise exceeds what they rest on, and the certificate none where a
    finding says that the leader goes beyond its limits.
    """
    columns = columns_of(run_data)
    given = run_data.scenario
    driven = run_data.motion_since_ns is not None
    scale = run_data.noise_scale
    estimation = judge_estimation(run_data, columns)
    summary = {
        "scenario": given.name,
        "seed": given.run.seed if driven and run_data.tracks is None else None,
        "mode": run_data.mode,
        "truth": None if run_data.tracks is None else "mocap",
        "estimator": short(given.estimator.kind),
        "law": law_json(given, run_data.law) if driven or len(columns.commands.issued_ns) else None,
        "duration_s": columns.run.seconds,
        "window": _window(run_data, columns),
        "frames": _frames(run_data),
        "estimation": estimation,
        "bounds": judge_bounds(given, columns)
        | judge_assumptions(given, columns)
        | judge_published(given, columns),
        "noise": judge_noise(scale),
        "certified": certain(judge_certified(run_data.certified, columns.truth, columns.span), scale),
        "certificate": supported(
            run_data.certificate or certificate_json(certificate_of(given, driven=driven)),
            refuted(scale, run_data.found or {}),
        ),
        "formation": judge_formation(run_data, columns),
        "latency_ms": _latency(columns),
        "cycles": _cycles(columns),
        "clock": judge_clock(arrival_rows(run_data)),
        "commands": _commands(columns),
        "orders_refused": refusal(given) if driven else None,
        "stopped_by": stopped_by(run_data.found or {}),
        "spells": bad_spells(run_data, columns),
        "findings": findings_list(run_data.found, judged_findings(estimation)),
        "rejected": dict(run_data.refused),
        "log": None if run_data.log is None else asdict(run_data.log),
    }
    result: dict[str, Any] = known(summary)
    return result


def _window(run_data: RunData, columns: Columns) -> dict[str, float] | None:
    """What is judged in seconds of the run, where that was asked for."""
    if run_data.evaluate_from_ns is None and run_data.evaluate_to_ns is None:
        return None
    span, zero_ns = columns.span, run_data.zero_ns
    return {"from_s": (span.from_ns - zero_ns) / 1e9, "to_s": (span.to_ns - zero_ns) / 1e9}


def _frames(run_data: RunData) -> dict[str, int | None]:
    frames, taken = run_data.frames, run_data.taken
    return {
        "published": frames.published if frames else None,
        "received": frames.received if frames else taken.get("frames"),
        "used": taken.get("used"),
        "lost": frames.published - frames.received if frames else None,
        "late": taken.get("late", 0) if taken else None,
        "rejected": sum(count for cause, count in run_data.refused.items() if cause != _STRANGERS),
    }


def _latency(columns: Columns) -> dict[str, dict[str, float]]:
    """From a capture to the first command that rests on an estimate of it."""
    commands = columns.commands
    first = commands.fresh & _in_run(columns)
    if not np.any(first):
        return {}
    waits_ms: FloatArray = np.asarray((commands.issued_ns - commands.capture_ns)[first] * 1e-6)
    return {"capture_to_command": {name: percentile(waits_ms, q) for name, q in PERCENTILES.items()}}


def _cycles(columns: Columns) -> dict[str, Any]:
    commands = columns.commands
    first = commands.fresh & _in_run(columns)
    return judge_cycles(commands.capture_ns[first], commands.issued_ns[first])


def percentile(values: FloatArray, q: float) -> float:
    """Percentile of at least one value, linear between neighbours: what ``np.percentile`` gives, to the bit.

    That one loads masked arrays, which takes longer than all of a short log.
    """
    ranked = np.sort(values)
    place = q / 100.0 * (len(ranked) - 1)
    before = math.floor(place)
    low, high = float(ranked[before]), float(ranked[min(before + 1, len(ranked) - 1)])
    share = place - before
    return high - (high - low) * (1.0 - share) if share >= 0.5 else low + (high - low) * share


def _commands(columns: Columns) -> dict[str, int]:
    commands, during = columns.commands, _in_run(columns)
    if not len(commands.issued_ns):
        return {}
    return {
        "sent": int(np.count_nonzero(during)),
        "saturated": int(np.count_nonzero(commands.saturated & during)),
        "stopped": int(np.count_nonzero(commands.stood & during)),
    }


def _in_run(columns: Columns) -> NDArray[np.bool_]:
    issued_ns = columns.commands.issued_ns
    return (issued_ns >= columns.run.from_ns) & (issued_ns < columns.run.to_ns)
