"""The rows of a follower's replay, and the Python side of its nodes: what compiled code works in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.time.delay_line import Arrival
from estimation.time.host_time import NO_TIME_YET, time_rows
from formation.lending import lent
from formation.records import Rows, columns_of, load, row_of, rows_of
from formation.station import Side
from hil.nodes.controller import ControllerNode, ControllerState
from hil.nodes.controller_desk import STOPS
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.nodes.status_reasons import ALL_REASONS
from hil.replay.kept_rows import CommandRow, DriveRow, EstimateRow, MotionRow, PoseRow, TruthRow
from hil.replay.pair_desk import NEVER, Lengths, Pair, Repeats, Roles, Tallies
from hil.replay.window import Number
from hil.wire.blake2b import BLOCK_BYTES
from hil.wire.cdr import packed_texts

SIDES = (Side.RIGHT, Side.LEFT)
_NOTHING_DONE = Repeats(0, 0, 0, 0, False, 0, 0, 0, 0, 0, 0, 0)
_NOTHING_KEPT = Tallies(0, 0, 0, 0, 0, 0, 0, 0, NEVER)
_KINDS: dict[str, type[Any]] = {
    "estimates": EstimateRow,
    "commands": CommandRow,
    "truths": TruthRow,
    "poses": PoseRow,
    "motions": MotionRow,
    "sent": DriveRow,
    "driven": DriveRow,
    "lost": Number,
    "arrivals": Arrival,
    "received": Number,
}
MOST_LOST = 1 << 16
"""How many missing inputs are looked for once more."""


class Capacity(NamedTuple):
    """How many rows of a kind there are to be at first."""

    estimates: int
    commands: int
    truths: int
    poses: int
    motions: int
    driven: int


@dataclass(slots=True, eq=False)
class Nodes:
    """The nodes of a follower and their states."""

    estimator: EstimatorNode
    controller: ControllerNode
    estimating: EstimatorState
    deciding: ControllerState

    @staticmethod
    def begun(estimator: EstimatorNode, controller: ControllerNode) -> Nodes:
        """Nodes that have not done anything."""
        return Nodes(estimator, controller, estimator.rows_only(0), controller.rows_only(0))


class PairRows:
    """Rows of one follower; ``window``: how many messages the window has room for."""

    def __init__(self, nodes: Nodes, roles: Roles, room: Capacity, window: int) -> None:
        self.nodes, self.roles = nodes, roles
        counts = room._asdict() | {"sent": room.commands, "arrivals": room.poses, "received": window}
        counts["lost"] = MOST_LOST
        self.window = window
        self.rows: dict[str, Rows[Any]] = {
            name: rows_of(kind, max(1, counts[name])) for name, kind in _KINDS.items()
        }
        self.estimating, self.deciding = row_of(_NOTHING_DONE), row_of(_NOTHING_DONE)
        self.tallies, self._roles = row_of(_NOTHING_KEPT), row_of(roles)
        texts = (
            nodes.estimator.packed_names,
            packed_texts(ALL_REASONS),
            packed_texts(["", *STOPS]),
            packed_texts([side.value for side in SIDES]),
        )
        self._texts = [np.frombuffer(text, dtype=np.uint8) for text in texts]
        drive = nodes.controller.drive.buffer
        self._lengths = row_of(Lengths._make([*map(len, texts), len(drive)]))
        self._scratch = np.zeros(len(drive) + 4 * BLOCK_BYTES + _longest(roles, nodes), dtype=np.uint8)
        self._time, self._times = time_rows(), row_of(NO_TIME_YET)

    def record(self) -> Pair:
        """All of the rows, as they are now."""
        names, reasons, stops, sides = self._texts
        return Pair(
            roles=self._roles,
            estimator=self.nodes.estimating.memory.desk,
            names=names,
            reasons=reasons,
            controller=self.nodes.deciding.desk,
            stops=stops,
            sides=sides,
            estimating=self.estimating,
            deciding=self.deciding,
            tallies=self.tallies,
            **self.rows,
            time=self._time,
            times=self._times,
            scratch=self._scratch,
            lengths=self._lengths,
        )

    def lent(self) -> NDArray[np.void]:
        """Where they all lie."""
        return columns_of(lent(self.record()))

    def grow(self, names: tuple[str, ...], more: int) -> None:
        """Give rows of these names room for more than they have."""
        for name in names:
            rows = columns_of(self.rows[name])
            grown = np.zeros(2 * len(rows) + more, dtype=rows.dtype)
            grown[: len(rows)] = rows
            self.rows[name] = grown  # type: ignore[assignment]

    def size(self, name: str) -> int:
        """How many rows there is room for."""
        return len(columns_of(self.rows[name]))

    def lengthen_received(self, window: int) -> None:
        """Follow a window that was made longer."""
        received = columns_of(self.rows["received"])
        longer = np.zeros(window, dtype=received.dtype)
        longer[: len(received)] = received
        self.rows["received"], self.window = longer, window  # type: ignore[assignment]

    def kept(self, name: str, count: int) -> NDArray[np.void]:
        """The first rows of a name."""
        return columns_of(self.rows[name])[:count]

    def tally(self) -> Tallies:
        """How many rows there are."""
        return load(Tallies, self.tallies, 0)


def _longest(roles: Roles, nodes: Nodes) -> int:
    return len(nodes.controller.topics.wanted.encode()) + 1
