"""What the tries came to: JSON, and a page in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from hil.faults.fault import Fault
from hil.faults.tally import COUNTS, LIMIT_S, Case, both, case_of_row


class Skipped(NamedTuple):
    """A fault that could not be tried here, and why."""

    fault: str
    why: str


NEVER_TRIED = (
    Skipped(
        "reorder",
        "TCP keeps the order of what it carries",
    ),
    Skipped("power", "a machine that loses its power at once takes hardware"),
)
"""What no machine tries."""

_HEAD = """# What happens when something fails

Written by `abreast faults --out DIR`: every fault is put into a live run, or into daemons that were started
by hand, with two robots that keep their last command for ever, as a TurtleBot3 does. A judge outside, which
shares nothing with abreast but the wire, takes what their drivers are told.

- `runaway_s`: from the reason to when the last command that moves a robot is no longer its driver's. The
  reason is the fault for the robot that it deprives; for all others it is the stop that the supervisor says
  when it has noticed. It may be {limit:g} s at most.
- `runaway_m`: the way rolled from the reason to standstill, the lag of the wheels included.
- `oldest`: the age by its stamp [s] of the oldest command that moved a robot.
- `lost`: logs that are gone or cannot be read; `exit`, `reason`: ends with another exit code, or without the
  words that name the fault; `hang`: processes that do not end; `left`: processes of the run that outlive it.
  All are to be 0.
- `memory`: the largest process [MB].

"""
_IN_ROS = """Drivers hear in ROS 2, by rclpy: guards speak to them without a bridge (`--ros`). Where a network
namespace is cut off, both robots lie in it, with their guards and the motion capture.

"""
_HEADS = (
    "fault",
    "tries",
    "runaway_s",
    "runaway_m",
    "oldest",
    "lost",
    "exit",
    "reason",
    "hang",
    "left",
    "memory",
)


def as_result(cases: Sequence[Case], skipped: Sequence[Skipped], *, ros: bool = False) -> dict[str, Any]:
    """The result as JSON has it; what is not covered stands apart, with what was measured of it.

    ``ros``: drivers heard in ROS.
    """
    return {
        "limit_s": LIMIT_S,
        "ros": ros,
        "cases": [case.as_row() for case in cases if not case.fault.uncovered],
        "not_covered": [
            {**case.as_row(), "why": case.fault.uncovered} for case in cases if case.fault.uncovered
        ],
        "skipped": [each._asdict() for each in skipped],
    }


def cases_of(result: Mapping[str, Any], faults: Sequence[Fault]) -> list[Case]:
    """The cases that a result has, in the order of the faults; of what is no fault any more there is none.

    Raises :class:`KeyError` for what is no result.
    """
    rows = {row["fault"]: row for row in (*result["cases"], *result["not_covered"])}
    return [case_of_row(fault, rows[fault.name]) for fault in faults if fault.name in rows]


def merged(before: Sequence[Case], now: Sequence[Case], faults: Sequence[Fault]) -> list[Case]:
    """Cases of two sessions, in the order of the faults, each with the tries of both."""
    found = {case.fault.name: case for case in before}
    for case in now:
        name = case.fault.name
        found[name] = both(found[name], case) if name in found else case
    return [found[fault.name] for fault in faults if fault.name in found]


def skipped_of(skipped: Sequence[Skipped], cases: Sequence[Case]) -> list[Skipped]:
    """What was skipped, each once, but what was tried after all."""
    tried = {case.fault.name for case in cases}
    whys = {each.fault: each for each in skipped if each.fault not in tried}
    return list(whys.values())


def as_markdown(cases: Sequence[Case], skipped: Sequence[Skipped], *, ros: bool = False) -> str:
    """The page; ``ros``: drivers heard in ROS."""
    covered = [case for case in cases if not case.fault.uncovered]
    failed = sum(case.failed for case in covered)
    tries = sum(case.tries for case in covered)
    worst = max((case.worst.runaway_s for case in covered), default=0.0)
    text = _HEAD.format(limit=LIMIT_S) + (_IN_ROS if ros else "")
    text += f"{len(covered)} faults, {tries} tries: {failed} beyond a limit; the longest runaway is "
    text += f"{worst:.2f} s.\n\n"
    text += _table(covered)
    uncovered = [case for case in cases if case.fault.uncovered]
    if uncovered:
        why = "; ".join(dict.fromkeys(case.fault.uncovered for case in uncovered))
        where = "[guard.md](guard.md#what-it-does-not-cover)"
        text += f"\n## Not covered\n\n{why[0].upper()}{why[1:]} ({where}).\n\n"
        text += _table(uncovered)
    if skipped:
        text += "\n## Not tried\n\n"
        text += "".join(f"- `{each.fault}`: {each.why}\n" for each in skipped)
    return text


def _table(cases: Sequence[Case]) -> str:
    rows = "".join(f"{row_of(case)}\n" for case in cases)
    return f"| {' | '.join(_HEADS)} |\n|{' --- |' * len(_HEADS)}\n{rows}"


def row_of(case: Case) -> str:
    """A case as a row of a table."""
    worst = case.worst
    counts = [str(getattr(worst, name)) for name in COUNTS]
    cells = [
        f"`{case.fault.name}`",
        str(case.tries),
        f"{worst.runaway_s:.2f}",
        f"{worst.runaway_m:.3f}",
        f"{worst.oldest_command_s:.3f}",
        *counts,
        f"{worst.memory_mb:.0f}",
    ]
    return f"| {' | '.join(cells)} |"
