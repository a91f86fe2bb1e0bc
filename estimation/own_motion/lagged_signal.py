"""A motion signal behind a first-order lag: its values and its integral, exact for samples of any spacing.

Between samples the signal is either held, as a command is, or linear. Either way the answer y of the lag to
a signal x, ``lag * y' = x - y``, has a closed form from sample to sample, and its integral is that of the
signal less ``lag`` times what the answer has gained.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.models.motion import Matrix, Vector
from formation.angles import FloatArray

SHORTEST_LAG = 1e-6
"""A lag [s] below this is none."""

Twists = NDArray[np.complex128]
"""Speeds v [m/s] and turn rates u [rad/s] as v + i u."""


@dataclass(frozen=True, slots=True, eq=False)
class LaggedSignal:
    """Twists ``told`` at increasing ``times`` [s]; ``held``: until the next one, else linear between them.

    Before the first sample and after the last one the signal is as there.
    """

    times: Vector
    told: Twists
    held: bool

    def slopes(self) -> Twists:
        """Change per second from each sample to the next; 0 of the last one."""
        if self.held or len(self.times) < 2:
            return np.zeros(len(self.told), dtype=np.complex128)
        return np.append(np.diff(self.told) / np.diff(self.times), 0.0)

    def states(self, lag: float) -> Twists:
        """Answer at the very time of every sample, the first one having been told for long."""
        kept = np.exp(-np.diff(self.times) / max(lag, SHORTEST_LAG))
        # Off the line that the answer tends to, lag behind the signal, it decays from sample to sample.
        behind = self.slopes()[:-1] * lag
        begins = self.told[:-1] - behind
        ends = begins if self.held else self.told[1:] - behind
        states = np.concatenate([self.told[:1], ends - begins * kept])
        # What is left of a state some samples later, for twice as many samples in each round.
        left, reach = np.concatenate([[0.0], kept]), 1
        while reach < len(states):
            states[reach:] += left[reach:] * states[:-reach]
            left[reach:] = left[reach:] * left[:-reach]
            reach *= 2
        return states

    def answers(self, at: Vector, lag: float, states: Twists) -> Twists:
        """Answer at any times, by the states of the lag."""
        place, since = self._places(at)
        behind = self.told[place] + self.slopes()[place] * (since - lag)
        left = states[place] - (self.told[place] - self.slopes()[place] * lag)
        answer: Twists = behind + left * np.exp(-since / max(lag, SHORTEST_LAG))
        return answer

    def ways(self, at: Vector) -> Twists:
        """Integral of the signal itself since the first sample."""
        steps, slopes = np.diff(self.times), self.slopes()
        whole = self.told[:-1] * steps + 0.5 * slopes[:-1] * steps**2
        sums = np.concatenate([[0.0], np.cumsum(whole)])
        place, since = self._places(at)
        way: Twists = sums[place] + self.told[place] * since + 0.5 * slopes[place] * since**2
        return way

    def answered_ways(self, at: Vector, lag: float, states: Twists) -> Twists:
        """Integral of the answer, but for a constant."""
        way: Twists = self.ways(at) - lag * self.answers(at, lag, states)
        return way

    def _places(self, at: Vector) -> tuple[NDArray[np.int64], FloatArray]:
        """The sample before each time, and the time [s] since then."""
        place = np.maximum(np.searchsorted(self.times, at, side="right") - 1, 0)
        return place, np.maximum(at - self.times[place], 0.0)


def columns_of(twists: Twists) -> Matrix:
    """Twists as rows (n, 2) of v and u."""
    return np.column_stack([twists.real, twists.imag])
