"""Arrivals of frames sorted by the epochs of the capture's clock, which jumps end."""

from __future__ import annotations

from typing import NamedTuple

from estimation.time.clock import Clock, ClockRows, heard
from estimation.time.delay_line import Arrival
from formation.kernel import kernel
from formation.records import Rows, load, size, store
from formation.ring import place


class InEpoch(NamedTuple):
    """An arrival, and the number of the epoch that it belongs to."""

    arrival: Arrival
    epoch: int


class Folded(NamedTuple):
    """The clock after all arrivals, the number of the last epoch, and how many arrivals belong to any."""

    clock: Clock
    epoch: int
    sorted: int


class ClockDesk(NamedTuple):
    """Rows to work in: the clock's, arrivals as they came, as many for those in epochs, and what is found."""

    rows: ClockRows
    arrivals: Rows[Arrival]
    found: Rows[InEpoch]
    folded: Rows[Folded]


@kernel
def sorted_into_epochs(desk: ClockDesk) -> None:
    """Fold all arrivals into a clock that has heard nothing. Those of a jump belong to the epoch after it."""
    folded = load(Folded, desk.folded, 0)
    clock, epoch, count = folded.clock, folded.epoch, folded.sorted
    for k in range(size(desk.arrivals)):
        arrival, jumps = load(Arrival, desk.arrivals, k), clock.jumps
        clock = heard(clock, desk.rows, arrival)
        if clock.jumps > jumps:
            epoch += 1
            for j in range(clock.recent.length):
                recent = load(Arrival, desk.rows.recent, place(clock.recent, desk.rows.recent, j))
                store(desk.found, count, InEpoch(recent, epoch))
                count += 1
        elif clock.suspects == 0:
            store(desk.found, count, InEpoch(arrival, epoch))
            count += 1
    store(desk.folded, 0, Folded(clock, epoch, count))
