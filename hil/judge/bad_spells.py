"""Bad spells of a run: when something was bad that a human would care about, why, and how far off it went."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.bounds.bound_check import ROUNDING
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray
from hil.judge.columns import Columns, inside
from hil.judge.estimation import errors_at
from hil.judge.intervals import TimeInterval, intervals_of
from hil.judge.run_data import RunData, Span
from hil.judge.spell_troubles import odometry_stretches, refused_in
from hil.judge.spell_words import FRAMES, ODOMETRY, OUTSIDE, STATUS, STOOD, Bad, causes_of
from hil.judge.true_states import Stamps
from hil.nodes.troubles import Trouble

LONGEST_SILENCE_S, SILENT_PERIODS = 0.25, 5
"""Without a frame for longer than both, the second in periods of the frames, the estimate is a guess."""
SHORTEST_LAPSE_S = 0.1
"""Estimates that are not TRACKING for less, as where a frame is turned away, or far off, are no spell."""
SIGMAS = 5.0
"""Of Gaussian errors one in two million lies so many deviations out."""
NEAR_S = 0.5
"""What is no further apart is one spell; errors of the estimates right after it are its doing."""
_BOUND = "its bound"
LASTING = 0.5
"""Odometry that is wrong for this share of the time is how the run was, which its finding says."""
WORST = ("v1", "alpha1")


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """What spells are looked for in: a span, what time in seconds counts from, and the columns."""

    span: Span
    zero_ns: int
    columns: Columns

    def seconds(self, moments_ns: Stamps) -> FloatArray:
        """Moments as seconds of the run."""
        return np.asarray((moments_ns - self.zero_ns) * 1e-9, dtype=np.float64)


def bad_spells(run_data: RunData, columns: Columns) -> list[dict[str, Any]]:
    """The ``spells`` of a summary in the order of time; empty for a run in which all went well.

    Looked for from when the leader had set off and the first estimate said TRACKING, or in what is to be
    judged where that was asked for. A spell begins with frames that stay away, estimates that do not say
    TRACKING, a follower that is told to stand after its first drive, judged errors of v1 and alpha1 outside
    five deviations or their published bound, or odometry that was found to be wrong for a while; what is no
    further apart than :data:`NEAR_S` is one.
    ``from_s``, ``to_s``: seconds of the run. ``causes``: in words. ``frames_lost``, ``untracked``,
    ``stopped``: frames, judged estimates and commands of the spell that count as such elsewhere in the
    summary. ``worst``: ``error`` (absolute) and capture time ``at_s`` by quantity, of the estimates that
    said TRACKING in it and up to :data:`NEAR_S` after it, where the truth is known.
    """
    watched = _watched(run_data, columns)
    lapses = list(_lapses(watched))
    odometry = list(_odometry(run_data.troubles, watched))
    # What stands in for the truth errs as much as good estimates do.
    outside = [] if run_data.tracks is not None else list(_outside(watched))
    found = [
        *(each for each in odometry if each.to_s - each.from_s < LASTING * watched.span.seconds),
        *_silences(run_data, watched),
        *_long(lapses),
        *_stood(watched),
        *(each for each in outside if _BOUND in each.what or each.to_s - each.from_s >= SHORTEST_LAPSE_S),
    ]
    joining = [*lapses, *odometry, *outside]
    return [_spell(watched, each, joining, run_data.troubles) for each in _merged(found)]


def _watched(run_data: RunData, columns: Columns) -> Watched:
    run, span, estimates = columns.run, columns.span, columns.estimates
    tracking_ns = estimates.told_ns[
        (estimates.status == Status.TRACKING) & (estimates.told_ns >= run.from_ns)
    ]
    from_ns = int(tracking_ns[0]) if len(tracking_ns) else run.from_ns
    if run_data.evaluate_from_ns is not None:
        from_ns = max(from_ns, span.from_ns)
    return Watched(Span(from_ns, min(run.to_ns, span.to_ns)), run_data.zero_ns, columns)


def _silences(run_data: RunData, watched: Watched) -> Iterator[Bad]:
    """Times between captures of estimates that are far apart, with the frames that are missing there.

    Estimates tell by the host's clock when frames were captured; frames do so by that of the motion capture.
    """
    estimates, span = watched.columns.estimates, watched.span
    captures_ns = np.unique(estimates.capture_ns)
    if len(captures_ns) < 2:
        return
    period_ns = max(1.0, float(np.median(np.diff(captures_ns))))
    longest_ns = max(LONGEST_SILENCE_S * 1e9, SILENT_PERIODS * period_ns)
    ends_ns = np.append(captures_ns[1:], max(span.to_ns, int(captures_ns[-1])))
    came = _counter(run_data)
    for row in np.flatnonzero(ends_ns - captures_ns > longest_ns).tolist():
        begin, end = max(int(captures_ns[row]), span.from_ns), min(int(ends_ns[row]), span.to_ns)
        if end - begin <= longest_ns:
            continue
        missing = max(0, round((end - begin) / period_ns) - 1)
        lost = max(0, missing - came(begin, end))
        from_s, to_s = watched.seconds(np.array([begin, end])).tolist()
        yield Bad(FRAMES, "", from_s, to_s, lost)


def _lapses(watched: Watched) -> Iterator[Bad]:
    """When estimates did not say TRACKING, by the time at which they were told."""
    estimates = watched.columns.estimates
    during = inside(estimates.told_ns, watched.span)
    status = estimates.status[during]
    names = [Status(code).name for code in status.tolist()]
    told = intervals_of(watched.seconds(estimates.told_ns[during]), names, NEAR_S)
    yield from _bad(STATUS, told, Status.TRACKING.name)


def _long(lapses: Sequence[Bad]) -> Iterator[Bad]:
    """Lapses that are long enough together with those that they go over into."""
    groups: list[list[Bad]] = []
    for each in lapses:
        if groups and each.from_s <= groups[-1][-1].to_s:
            groups[-1].append(each)
        else:
            groups.append([each])
    for group in groups:
        if group[-1].to_s - group[0].from_s >= SHORTEST_LAPSE_S:
            yield from group


def _stood(watched: Watched) -> Iterator[Bad]:
    """When the follower was told to stand after its first drive, by reason."""
    commands = watched.columns.commands
    stood = commands.stood
    during = inside(commands.issued_ns, watched.span) & (commands.issued_ns < watched.columns.run.to_ns)
    if not np.any(stood & during):
        return
    reasons = [commands.stop[row] if stood[row] else "" for row in np.flatnonzero(during).tolist()]
    told = intervals_of(watched.seconds(commands.issued_ns[during]), reasons, NEAR_S)
    yield from _bad(STOOD, told, "")


def _outside(watched: Watched) -> Iterator[Bad]:
    """When judged errors lay outside so many deviations, or outside the bound that they went out with."""
    samples, columns = watched.columns.samples, watched.columns
    errors = errors_at(samples, columns.true)
    during = inside(samples.capture_ns, watched.span)
    at_s = watched.seconds(samples.capture_ns[during])
    for place, name in enumerate(WORST):
        if name not in errors:
            continue
        error = np.abs(errors[name])
        limits = {f"{SIGMAS:.0f} sigma": SIGMAS * samples.sd[:, QUANTITIES.index(name)]}
        if samples.bounds is not None:
            limits[_BOUND] = samples.bounds[:, place]
        for what, limit in limits.items():
            beyond: NDArray[np.bool_] = error > limit + ROUNDING
            if np.any(beyond[during]):
                words = [f"{name} outside {what}" if each else "" for each in beyond[during].tolist()]
                yield from _bad(OUTSIDE, intervals_of(at_s, words, NEAR_S), "")


def _odometry(troubles: Sequence[Trouble], watched: Watched) -> Iterator[Bad]:
    """When odometry was found to be wrong."""
    for name, span in odometry_stretches(troubles):
        begin, end = max(span.from_ns, watched.span.from_ns), min(span.to_ns, watched.span.to_ns)
        if begin < end:
            from_s, to_s = watched.seconds(np.array([begin, end])).tolist()
            yield Bad(ODOMETRY, name, from_s, to_s, 0)


def _bad(kind: str, intervals: Sequence[TimeInterval], good: str) -> Iterator[Bad]:
    for each in intervals:
        if each.what != good:
            yield Bad(kind, each.what, each.from_s, each.to_s, each.count)


def _counter(run_data: RunData) -> Callable[[int, int], int]:
    """How many frames came of those captured between two moments, where their captures are known."""
    frames = run_data.frames
    captures_ns = np.sort(np.asarray([] if frames is None else frames.captures_ns, dtype=np.int64))

    def came(from_ns: int, to_ns: int) -> int:
        first = np.searchsorted(captures_ns, from_ns, side="right")
        return int(np.searchsorted(captures_ns, to_ns, side="left") - first)

    return came


def _merged(found: Sequence[Bad]) -> list[list[Bad]]:
    """What is near in time together."""
    groups: list[list[Bad]] = []
    until_s = 0.0
    for each in sorted(found, key=lambda bad: bad.from_s):
        if groups and each.from_s <= until_s + NEAR_S:
            groups[-1].append(each)
            until_s = max(until_s, each.to_s)
        else:
            groups.append([each])
            until_s = each.to_s
    return groups


def _spell(
    watched: Watched, bad: Sequence[Bad], joining: Sequence[Bad], troubles: Sequence[Trouble]
) -> dict[str, Any]:
    from_s, to_s = min(each.from_s for each in bad), max(each.to_s for each in bad)
    others = [each for each in joining if each not in bad and from_s <= each.to_s and each.from_s <= to_s]
    span = Span(*(watched.zero_ns + round(at_s * 1e9) for at_s in (from_s, to_s)))
    return {
        "from_s": from_s,
        "to_s": to_s,
        "causes": [*causes_of([*bad, *others]), *refused_in(troubles, span)],
        "frames_lost": sum(each.count for each in bad if each.kind == FRAMES),
        **_counts(watched, from_s, to_s),
        "worst": _worst(watched, from_s, to_s + NEAR_S),
    }


def _counts(watched: Watched, from_s: float, to_s: float) -> dict[str, int]:
    columns = watched.columns
    estimates, commands = columns.estimates, columns.commands
    told_s, issued_s = watched.seconds(estimates.told_ns), watched.seconds(commands.issued_ns)
    lapsed = (estimates.status != Status.TRACKING) & inside(estimates.capture_ns, columns.span)
    during = commands.issued_ns < columns.run.to_ns
    return {
        "untracked": int(np.count_nonzero(lapsed & (told_s >= from_s) & (told_s <= to_s))),
        "stopped": int(np.count_nonzero(commands.stood & during & (issued_s >= from_s) & (issued_s <= to_s))),
    }


def _worst(watched: Watched, from_s: float, to_s: float) -> Mapping[str, Mapping[str, float]]:
    estimates = watched.columns.estimates
    at_s = watched.seconds(estimates.capture_ns)
    told = (estimates.status == Status.TRACKING) & inside(estimates.capture_ns, watched.span)
    told &= (at_s >= from_s) & (at_s <= to_s)
    if not np.any(told):
        return {}
    tracked = estimates.only(told)
    errors = errors_at(tracked, watched.columns.truth.at(tracked.capture_ns))
    worst = {}
    for name in WORST:
        if name in errors:
            size = np.abs(errors[name])
            row = int(np.nanargmax(size))
            worst[name] = {"error": float(size[row]), "at_s": round(float(at_s[told][row]), 6)}
    return worst
