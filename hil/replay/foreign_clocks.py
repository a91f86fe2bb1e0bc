"""Clocks of the topics of a foreign log: by how much each one's stamps are off the log's time.

Ages are log time minus stamp. What a topic's clock is behind cannot be told from how long its messages take,
so that a clock counts as right as long as its freshest message is up to a second old.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median_low
from typing import NamedTuple

_OTHER_CLOCK_NS = 1_000_000_000
_WILD_NS = 1_000_000_000


class Clocks(NamedTuple):
    """What is done about clocks, in ns.

    ``log_shift``: taken off all log times, where all stamps run on one other clock than the log. ``shifts``:
    by topic, added to its stamps, where its clock differs from those of others; no entry for those that are
    right. ``freshest``: by topic, the least age that is credible; what is younger by more than a second has a
    stamp that its own clock did not give.
    """

    log_shift: int
    shifts: Mapping[str, int]
    freshest: Mapping[str, int]

    def is_wild(self, topic: str, age_ns: int) -> bool:
        """Whether a stamp lies in the future of those beside it."""
        return age_ns < self.freshest[topic]


def clocks_of(ages: Mapping[str, Sequence[int]]) -> Clocks:
    """Clocks by the ages [ns] of messages on each topic, in an order in which the first is to be trusted.

    >>> clocks_of({"frames": [300_000_000_005, 300_000_000_009], "odom": [2, -3_600_000_000_000, 3]})
    Clocks(log_shift=0, shifts={'frames': 300000000005}, freshest={'frames': 300000000005, 'odom': 2})
    """
    freshest = {}
    for topic, told in ages.items():
        usual = median_low(told)
        freshest[topic] = min(age for age in told if age >= usual - _WILD_NS)
    right = [age for age in freshest.values() if 0 <= age <= _OTHER_CLOCK_NS]
    anchor = right[0] if right else next(iter(freshest.values()))
    alike = [age for age in freshest.values() if abs(age - anchor) <= _OTHER_CLOCK_NS]
    log_shift = 0 if 0 <= min(alike) <= _OTHER_CLOCK_NS else min(alike)
    shifts = {
        topic: age - log_shift for topic, age in freshest.items() if abs(age - anchor) > _OTHER_CLOCK_NS
    }
    return Clocks(log_shift, shifts, freshest)


def clock_finding(clocks: Clocks, wild: Mapping[str, int], counts: Mapping[str, int]) -> str:
    """What is wrong with the clocks, in one line; empty if nothing is. ``wild``, ``counts``: by topic."""
    said = []
    for topic, shift in clocks.shifts.items():
        where = "behind" if shift > 0 else "ahead of"
        said.append(
            f"stamps on {topic!r} are {abs(shift) * 1e-9:.3f} s {where} the other clocks; "
            "shifted so that the freshest has no age"
        )
    said += [
        f"{number} of {counts[topic]} stamps on {topic!r} lie in the future of all others there; "
        "these messages are left out"
        for topic, number in wild.items()
        if number
    ]
    return "; ".join(said)
