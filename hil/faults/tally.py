"""The worst of all tries of each fault, as the report has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from hil.faults.attempt import Try
from hil.faults.fault import Fault

LIMIT_S = 0.3
"""So long [s] after its reason a robot may be told to move, and so old may a command be that it obeys."""

COUNTS = ("lost_logs", "wrong_exit", "wrong_reason", "hangs", "orphans")
"""What is to be zero in every case."""


@dataclass(frozen=True, slots=True)
class Case:
    """A fault and the worst of its tries."""

    fault: Fault
    tries: int
    worst: Try

    @property
    def failed(self) -> bool:
        """Whether something is wrong that is not known to be uncovered."""
        return is_wrong(self.worst) and not self.fault.uncovered

    def as_row(self) -> dict[str, Any]:
        """The case as JSON has it, with every number."""
        figures = {name: getattr(self.worst, name) for name in _FIGURES}
        return {
            "fault": self.fault.name,
            "role": self.fault.role,
            "mode": self.fault.mode,
            "tries": self.tries,
            **{name: round(each, 4) if isinstance(each, float) else each for name, each in figures.items()},
        }


def case_of_row(fault: Fault, row: Mapping[str, Any]) -> Case:
    """The case of a row of a result, to its four decimals; raises :class:`KeyError` for what is none."""
    return Case(fault, int(row["tries"]), Try(**{name: row[name] for name in _FIGURES}))


def both(first: Case, second: Case) -> Case:
    """A case of the tries of two."""
    return Case(first.fault, first.tries + second.tries, worst_of([first.worst, second.worst]))


def is_wrong(worst: Try) -> bool:
    """Whether figures are beyond what they may be."""
    beyond = max(worst.runaway_s, worst.oldest_command_s) > LIMIT_S
    return beyond or any(getattr(worst, name) for name in COUNTS)


def worst_of(tries: Sequence[Try]) -> Try:
    """The largest of each figure over tries, counts added up, and all that was wrong."""
    wrong = tuple(dict.fromkeys(text for each in tries for text in each.wrong))
    return Try(
        **{name: max(getattr(each, name) for each in tries) for name in _LARGEST},
        **{name: sum(getattr(each, name) for each in tries) for name in COUNTS},
        wrong=wrong,
    )


_FIGURES = tuple(each.name for each in fields(Try) if each.name != "wrong")
_LARGEST = ("runaway_s", "runaway_m", "oldest_command_s", "memory_mb")
