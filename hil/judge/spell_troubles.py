"""What nodes reported while something was bad: inputs that were refused, and odometry that was wrong."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from hil.judge.run_data import Span
from hil.nodes.troubles import Trouble

REPORT_NS = 500_000_000
"""From report to report: what is refused stands in the one after."""
_STRANGERS = "unknown_body"
_ODOMETRY = "odometry_"
_NOTHING: Mapping[str, int] = {}


def refused_in(troubles: Sequence[Trouble], spell: Span) -> Iterator[str]:
    """What an estimator refused in a spell, by cause with counts, in words; nothing if that was none."""
    moments = [trouble.at_ns for trouble in troubles]
    first, last = bisect_right(moments, spell.from_ns), bisect_right(moments, spell.to_ns + REPORT_NS)
    before = troubles[first - 1].refused if first else _NOTHING
    after = troubles[last - 1].refused if last else _NOTHING
    grown = {cause: count - before.get(cause, 0) for cause, count in after.items() if cause != _STRANGERS}
    told = [f"{cause.replace('_', ' ')} {count}" for cause, count in sorted(grown.items()) if count > 0]
    if told:
        yield f"inputs refused: {', '.join(told)}"


def odometry_stretches(troubles: Sequence[Trouble]) -> Iterator[tuple[str, Span]]:
    """Over what odometry was found to be wrong, by the finding's name: from report to report."""
    names = {name for trouble in troubles for name in trouble.found if name.startswith(_ODOMETRY)}
    for name in sorted(names):
        moments = [trouble.at_ns for trouble in troubles if name in trouble.found]
        first = moments[0]
        for last, after in pairwise([*moments, None]):
            if last is not None and (after is None or after - last > 2 * REPORT_NS):
                yield name, Span(first, last + REPORT_NS)
                first = after if after is not None else first
