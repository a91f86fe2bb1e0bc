"""What a person reads at the end of a run or a replay: a few lines from its summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from hil.judge.consistency import are_telling
from hil.judge.made_by import law_failure, made_by
from hil.judge.noise import noise_warnings
from hil.judge.spell_words import said_by_spells, spell_lines
from hil.log.report_json import result_console
from hil.nodes.findings import finding_line

GOOD, BAD, PLAIN = "green", "bold red", ""
LEAST_COVERAGE = 0.97
"""Of Gaussian errors 99.7 % lie within three standard deviations; below this share they were too small."""
NIS_RANGE = (1.0, 3.0)
"""Where the mean NIS of a filter is that knows its noise; 2 is the mean for a position in the plane."""
LEAST_KEPT = 0.9
"""Assumed errors are three standard deviations of several inputs; below this share they were too small."""
LOST_SHARE = 0.01
GATED_SHARE, GATED_AT_ONCE = 0.005, 5
"""Where a leader brakes hard, as at the stop that ends a run, the gate turns a few frames away."""
SATURATED_SHARE = 0.5
STOPPED_SHARE = 0.02
OFF_SHARE = 0.25
"""A pair that is further off the noise-free run than this share of its least distance is not in formation."""


def print_summary(summary: Mapping[str, Any], console: Console | None = None) -> None:
    """Print a summary, ``parity`` included, where results are read or on another console."""
    console = console or result_console()
    table = Table.grid(padding=(0, 2))
    for name, finding, style in verdict_lines(summary):
        table.add_row(Text(name, style="bold"), Text(finding, style=style))
    console.print(table)
    for warning in warnings_of(summary):
        console.print(Text.assemble(("! ", "bold yellow"), warning), soft_wrap=True)


def warnings_of(summary: Mapping[str, Any]) -> list[str]:
    """What deserves a second look, in plain words."""
    return [warning for warnings in warnings_by_part(summary).values() for warning in warnings]


def warnings_by_part(summary: Mapping[str, Any]) -> dict[str, list[str]]:
    """What deserves a second look, by the part of a run that it is about."""
    law = filter(None, [law_failure(summary)])
    return {
        "spells": [*spell_lines(summary)],
        "tracking": [*_estimation_warnings(summary)],
        "bounds": [
            *_bound_warnings(summary),
            *noise_warnings(summary),
            *_assumption_warnings(summary),
            *_certified_warnings(summary),
        ],
        "formation": [*_formation_warnings(summary)],
        "saturation": [*_command_warnings(summary), *law],
        "latency": [*_wire_warnings(summary)],
        "findings": [*map(finding_line, summary.get("findings", []))],
    }


def verdict_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Name, finding and style (``GOOD``, ``BAD`` or ``PLAIN``) of every line of the verdict."""
    who = ", ".join(made_by(summary))
    seed = f", seed {summary['seed']}" if "seed" in summary else ""
    title = f"{summary['scenario']}, {summary['mode']}, {summary['duration_s']:.1f} s ({who}{seed})"
    yield "run", title, PLAIN
    if judged := judged_by(summary):
        yield "judged", judged, PLAIN
    yield from _estimate_lines(summary)
    yield from _certified_line(summary)
    formation = summary.get("formation", {})
    if "rho_min" in formation:
        text = f"rho {formation['rho_min']:.3f} to {formation['rho_max']:.3f} m"
        if "orbit_deviation_rms" in formation:
            text += f", {1e3 * formation['orbit_deviation_rms']['rho']:.1f} mm RMS off the noise-free run"
        yield "formation", text, PLAIN
    yield from _wire_lines(summary)
    yield from parity_line(summary)
    if "log" in summary:
        log = summary["log"]
        yield "log", f"{log['path']} ({log['messages']} messages, {log['bytes'] / 1e6:.1f} MB)", PLAIN


def judged_by(summary: Mapping[str, Any]) -> str:
    """What stood for the truth, and which part of a run was judged; empty for all of it by the truth."""
    told = []
    if summary.get("truth") == "mocap":
        told.append("by the smoothed mocap tracks, whose own errors are in what follows")
    if window := summary.get("window"):
        told.append(
            f"from {window['from_s']:.4g} to {window['to_s']:.4g} s only: estimates, bounds, formation, bad "
            "spells; frames, latency, commands, inputs refused and findings are of the whole run"
        )
    return "; ".join(told)


def parity_line(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The line of the verdict on a verified replay, if it is one."""
    parity = summary.get("parity")
    if parity is not None:
        wrong = sum(part["mismatched"] for part in parity.values())
        compared = sum(part["compared"] for part in parity.values())
        verdict = f"{compared} messages compared, {wrong} differ"
        yield "replay", verdict, GOOD if compared and not wrong else BAD


def _estimate_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    estimation = summary["estimation"]
    rmse = estimation.get("rmse", {})
    parts = []
    if "v1" in rmse:
        parts.append(f"v1 {1e3 * rmse['v1']:.1f} mm/s{_largest(estimation, 'v1', 1e3)}")
    if "alpha1" in rmse:
        degrees = math.degrees(1.0)
        parts.append(f"alpha1 {degrees * rmse['alpha1']:.2f} deg{_largest(estimation, 'alpha1', degrees)}")
    if parts:
        judged = f"({estimation['samples']} samples from {estimation['evaluated_from_s']:.3g} s on)"
        yield "estimate", f"RMSE {', '.join(parts)} {judged}", PLAIN
    yield from _nees_line(estimation)
    yield from _bound_lines(summary)


def _largest(estimation: Mapping[str, Any], name: str, scale: float) -> str:
    """The largest error of a quantity in its unit, and when it was, where that is known."""
    if name not in estimation.get("max_at_s", {}):
        return ""
    return f" (largest {scale * estimation['max'][name]:.3g} at {estimation['max_at_s'][name]:.2f} s)"


def _bound_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The bounds that estimates went out with; and those whose premise are the errors that were seen."""
    bounds = summary["bounds"]
    published = bounds.get("published", {})
    if "violations" in published:
        count, style = _times(sum(published["violations"].values()))
        v1, alpha1 = (published["median"][name] for name in ("v1", "alpha1"))
        within = f"v1 within {1e3 * v1:.1f} mm/s, alpha1 within {math.degrees(alpha1):.0f} deg (medians)"
        used = f"errors up to {max(published['tightness'].values()):.0%}"
        yield "bounds", f"{within}, violated {count} in {published['checked']} samples ({used})", style
    if "violations" in bounds:
        count, style = _times(sum(extended_violations(summary).values()))
        shares = [value for name, value in bounds["tightness"].items() if name.endswith("_extended")]
        tight = f" (errors up to {max(shares):.0%})" if shares else ""
        verdict = f"by the largest errors seen: extended ones violated {count} in {bounds['checked']} samples"
        yield "", verdict + tight, style


def _times(broken: int) -> tuple[str, str]:
    """How often bounds were violated, in words, with its style."""
    return (f"{broken} times", BAD) if broken else ("nowhere", GOOD)


def _nees_line(estimation: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    limits = estimation.get("nees_limits", {})
    parts = []
    for name in ("v1", "alpha1", "u1"):
        if name in limits:
            low, high = limits[name]
            expected = f"{low:.2f} to {high:.2f}" if are_telling(limits[name]) else "too short to tell"
            parts.append(f"{name} {estimation['nees'][name]:.2f} ({expected})")
    if parts:
        yield "nees", f"squared errors over their variances: {', '.join(parts)}", PLAIN


def _certified_line(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    certified = summary.get("certified", {})
    v1, alpha1 = certified.get("v1", {}), certified.get("alpha1", {})
    if "median" not in v1:
        return
    radii = f"v1 within {1e3 * v1['median']:.0f} mm/s, alpha1 within {math.degrees(alpha1['median']):.1f} deg"
    if "violations" not in v1:
        yield "certified", f"{radii} (medians of {certified['certified']} samples)", PLAIN
        return
    broken = v1["violations"] + alpha1["violations"]
    count = f"{broken} times" if broken else "nowhere"
    tight = f"errors up to {max(v1['tightness'], alpha1['tightness']):.0%}"
    verdict = f"{radii} (medians), violated {count} in {certified['certified']} samples ({tight})"
    yield "certified", verdict, BAD if broken else GOOD


def _certified_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    certified = summary.get("certified", {})
    if failed := certified.get("failed", {}):
        causes = ", ".join(f"{cause} {count}" for cause, count in sorted(failed.items()))
        total = certified["certified"] + sum(failed.values())
        yield f"{sum(failed.values())} of {total} estimates could not be certified: {causes}"


def _wire_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    frames = summary.get("frames", {})
    if "received" in frames:
        lost = f", {frames['lost']} lost" if "lost" in frames else ""
        late = f", {frames['late']} late" if frames.get("late") else ""
        yield "frames", f"{frames['received']} received{lost}{late}", PLAIN
    latency = summary.get("latency_ms", {}).get("capture_to_command")
    if latency:
        text = (
            f"capture to command {latency['p50']:.1f} ms, p99 {latency['p99']:.1f}, max {latency['max']:.1f}"
        )
        cycles = summary.get("cycles", {})
        if cycles.get("late"):
            text += f"; {cycles['late']} of {cycles['count']} later than {cycles['limit_ms']:.1f} ms"
        yield "latency", text, PLAIN
    yield from _clock_lines(summary)


def _clock_lines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    clock, own = summary.get("clock"), summary.get("own_motion")
    if clock:
        jitter, offset = clock["jitter_ms"], clock["offset_ms"]
        side = f"{-offset:.1f} ms after" if offset <= 0.0 else f"{offset:.1f} ms before"
        drift = f", drift {round(clock['drift_ppm'], 1) + 0.0} ppm" if "drift_ppm" in clock else ""
        text = f"frames come {side} their stamps at the least{drift}"
        yield "clock", f"{text}, jitter p50 {jitter['p50']:.1f} ms, p99 {jitter['p99']:.1f}", PLAIN
    if own:
        parts = []
        if "delay_s" in own:
            parts.append(f"moves {round(1e3 * own['delay_s'])} ms after odometry")
        if own.get("time_constant_s"):
            parts.append(f"answers it with a lag of {round(1e3 * own['time_constant_s'])} ms")
        for name, what in (("scale_v", "speed"), ("scale_u", "turn rate")):
            if name in own:
                parts.append(f"{what} {own[name]:.3f} of odometry's")
        yield "follower", ", ".join(parts), PLAIN


def extended_violations(summary: Mapping[str, Any]) -> dict[str, int]:
    """Extended bounds that were violated, by name, with the number of samples."""
    counts = summary["bounds"].get("violations", {})
    return {name: count for name, count in counts.items() if name.endswith("_extended") and count}


def _estimation_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    estimation = summary["estimation"]
    samples, untracked = estimation["samples"], estimation.get("untracked", 0)
    if not samples:
        yield "nothing to judge: no estimate was marked as tracking in the time that is judged"
        return
    if (elsewhere := untracked - said_by_spells(summary, "untracked")) > 0:
        also = " besides" if elsewhere < untracked else ""
        yield f"{elsewhere} of {samples + untracked} estimates did not say tracking{also}; none is judged"
    low = {
        name: share
        for name, share in estimation.get("coverage_3sigma", {}).items()
        if name in ("v1", "alpha1", "u1") and share < LEAST_COVERAGE
    }
    for name, share in low.items():
        yield f"the estimator is too sure of {name}: only {share:.1%} of errors within 3 standard deviations"
    nis = estimation.get("nis_mean")
    if nis is not None and not NIS_RANGE[0] <= nis <= NIS_RANGE[1]:
        noisier = "noisier" if nis > NIS_RANGE[1] else "quieter"
        yield f"the measurements are {noisier} than the scenario says (mean NIS {nis:.2g}, expected 2)"


def _bound_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    for name, count in extended_violations(summary).items():
        yield f"bound {name} does not hold in {count} samples: check the noise and leader limits it rests on"
    for name, count in summary["bounds"].get("published", {}).get("violations", {}).items():
        if count:
            yield (
                f"bound_{name} as published does not hold in {count} samples: noise or leader went beyond "
                "what the scenario says of them"
            )


def _assumption_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    kept = summary["bounds"].get("input_errors_hold", {})
    if kept.get("all", 1.0) >= LEAST_KEPT:
        return
    each = ", ".join(f"{name} {share:.0%}" for name, share in kept.items() if name != "all")
    yield (
        f"inputs err as little as the scenario assumes in {kept['all']:.0%} of the samples only ({each}): "
        "the bounds shown live rest on that"
    )


def _formation_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    formation = summary.get("formation", {})
    off = formation.get("orbit_deviation_rms", {}).get("rho", 0.0)
    if off > OFF_SHARE * formation.get("rho_min", math.inf):
        yield f"the formation is not kept: the distance is {off:.2g} m RMS off the noise-free run"
    if "orders_refused" in summary:
        yield summary["orders_refused"]


def _command_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    commands = summary.get("commands", {})
    sent = commands.get("sent", 0)
    stopped = commands.get("stopped", 0) - said_by_spells(summary, "stopped")
    if stopped > STOPPED_SHARE * sent:
        share = f"{stopped / sent:.0%}"
        where = _where(summary)
        yield f"in {share} of the commands{where} the robot was told to stand still after its first drive"
    if commands.get("saturated", 0) > SATURATED_SHARE * sent:
        share = f"{commands['saturated'] / sent:.0%}"
        yield f"{share} of the commands{_where(summary)} were at a limit of the robot"


def _where(summary: Mapping[str, Any]) -> str:
    """What counts of the whole run are of, where less of it is judged."""
    return " of the whole run" if summary.get("window") else ""


def _wire_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    frames = summary.get("frames", {})
    lost, published = frames.get("lost", 0), frames.get("published", 0)
    lost -= said_by_spells(summary, "frames_lost")
    if lost > LOST_SHARE * published:
        yield f"{lost / published:.1%} of the frames{_where(summary)} never reached the estimator"
    clock = summary.get("clock", {})
    if clock.get("jumps"):
        times = "once" if clock["jumps"] == 1 else f"{clock['jumps']} times"
        yield f"the clock of the motion capture jumped {times}"
    rejected = summary.get("rejected", {})
    expected = max(GATED_AT_ONCE, GATED_SHARE * frames.get("received", 0))
    if set(rejected) - {"gated"} or rejected.get("gated", 0) > expected:
        causes = ", ".join(f"{cause.replace('_', ' ')} {count}" for cause, count in sorted(rejected.items()))
        yield f"inputs refused: {causes}"
