"""What a replay in one pass leaves: rows for the judge, and how the outputs compare with those logged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hil.nodes.findings import Findings
from hil.nodes.node import Counts
from hil.nodes.troubles import Trouble
from hil.replay.re_execution import Parity
from hil.scenario.links import Link
from hil.scenario.schema import Scenario

Array = NDArray[np.void]


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """What a pass over a log has kept of a follower's messages, in the order of the log.

    ``estimates``, ``commands``: as they came out of the replay, rows of :mod:`hil.replay.kept_rows`, and so
    are ``truths``, ``poses`` and ``motions``. ``arrivals``: frames that the estimator took in. ``sides``: log
    time and payload of orders to change them. ``reports``: the last values of every node by its name.
    ``found``: what nodes reported to be wrong at any time, likewise; ``troubles``: when.
    ``stopped_ns``: when the first stop was logged.
    """

    estimates: Array
    commands: Array
    truths: Array
    arrivals: Array
    poses: Array
    motions: Array
    sides: Sequence[tuple[int, bytes]]
    reports: Mapping[str, Mapping[str, str]]
    stopped_ns: int | None
    found: Mapping[str, Findings] = field(default_factory=dict)
    troubles: Mapping[str, Sequence[Trouble]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class KeptReplay:
    """A replay of one follower, as :class:`hil.replay.rerun.Replay` is, with rows in the place of messages.

    ``taken``, ``refused``, ``noise_scale``: the estimator's counts, and the noise that it found. ``found``:
    findings of the nodes that were replayed, by their names, as seen now and then. ``fed`` is empty, since
    who is fed is replayed otherwise.
    """

    link: Link
    kept: Kept
    taken: Counts
    refused: Counts
    parity: Mapping[str, Parity] = field(default_factory=dict)
    missing_inputs: int = 0
    restarts: Mapping[str, int] = field(default_factory=dict)
    fed: str = ""
    noise_scale: float | None = None
    found: Mapping[str, Findings] = field(default_factory=dict)

    @property
    def scenario(self) -> Scenario:
        """The pair's scenario."""
        return self.link.scenario
