"""The replay of one follower, seen from Python: its rows, what differs, where a node was started again."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from formation.records import Rows, columns_of, load, store
from hil.errors import AbreastError
from hil.log.reader import Log
from hil.nodes.controller import ControllerNode, ControllerState
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.nodes.findings import Findings, all_found
from hil.nodes.troubles import Trouble
from hil.replay.kept import Array, Kept, KeptReplay
from hil.replay.pair_desk import NEVER, Repeats, Roles
from hil.replay.pair_rows import MOST_LOST, Capacity, Nodes, PairRows
from hil.replay.re_execution import Parity, compare_in_order
from hil.replay.window import NOT_WANTED
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.message_types import Command
from hil.wire.messages import typename_of
from hil.wire.topics import link_topics
from hil.wire.writing import MOST_RECEIPTS

_MORE = MOST_RECEIPTS + 2


class OddLogError(AbreastError):
    """A log has something that this way of replaying cannot do justice to."""


class Part(NamedTuple):
    """One of the two nodes, and what rows it fills."""

    node: str
    rows: tuple[str, ...]


ESTIMATES, DECIDES = Part("estimator", ("estimates",)), Part("controller", ("commands", "sent"))


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """What there was before an output is tried again, to have it back."""

    state: EstimatorState | ControllerState
    done: Repeats
    sent: int
    rows: Mapping[str, Array]


class FollowerReplay:
    """Replay by a link; ``same``: its steps are those of the log; ``tracks``: its own motion is kept.

    ``numbers``: those of the topics in a window that has ``room`` for so many messages.
    """

    def __init__(
        self,
        log: Log,
        link: Link,
        numbers: Mapping[str, int],
        nodes: tuple[EstimatorNode, ControllerNode],
        room: int,
        *,
        same: bool,
        tracks: bool,
    ) -> None:
        self.link, self.names, self.same, self._tracks = link, link_topics(link), same, tracks
        self.nodes = Nodes.begun(*nodes)
        self._decides = same and log.topics.get(self.names.command) == typename_of(Command)
        self.restarts = {part.node: 0 for part in (ESTIMATES, DECIDES)}
        self.wrong: dict[str, list[int]] = {part.node: [] for part in (ESTIMATES, DECIDES)}
        self._gap_s = {part.node: 0.0 for part in (ESTIMATES, DECIDES)}
        self.rows = PairRows(self.nodes, self._roles(numbers), self._capacity(log), room)
        self._found: dict[str, dict[str, str]] = {}

    def _roles(self, numbers: Mapping[str, int]) -> Roles:
        names, heard = self.names, self.nodes.controller.subscribes
        return Roles(
            frame=numbers[topics.RIGID_BODIES],
            odometry=numbers[names.odom],
            sighting=numbers[names.sighting],
            estimate=numbers[names.estimate],
            command=numbers[names.command],
            drive=numbers[names.wanted],
            leader_drive=_heard(names.leader_cmd_vel, heard, numbers),
            side=_heard(names.side, heard, numbers),
            stop=numbers[topics.STOP],
            truth=numbers[names.truth],
            stamped=names.stamped,
            compares=self.same,
            decides=self._decides,
            tracks=self._tracks,
        )

    def _capacity(self, log: Log) -> Capacity:
        names, counts = self.names, log.counts
        return Capacity(
            estimates=counts.get(names.estimate, 0) + _MORE,
            commands=counts.get(names.command, 0) + _MORE,
            truths=counts.get(names.truth, 0) + 1,
            poses=counts.get(topics.RIGID_BODIES, 0) + 1,
            motions=counts.get(names.odom, 0) + 1,
            driven=counts.get(names.wanted, 0) + 1,
        )

    def repeats(self, part: Part) -> Rows[Repeats]:
        """How far a part is, in a row."""
        return self.rows.estimating if part is ESTIMATES else self.rows.deciding

    def needed(self) -> list[tuple[int, int]]:
        """For each part the first message that it has to look at, and when its last output was logged."""
        tally = self.rows.tally()
        parts = (ESTIMATES, DECIDES) if self._decides else (ESTIMATES,)
        done = [load(Repeats, self.repeats(part), 0) for part in parts]
        return [(min(each.next, tally.next), each.logged_ns) for each in done]

    @property
    def lacks(self) -> bool:
        """Whether the estimator lacks inputs: these may have been edited."""
        return load(Repeats, self.rows.estimating, 0).missing > 0

    @property
    def lost(self) -> NDArray[np.int64] | None:
        """Digests of inputs that were missing, None for more than are kept."""
        count = self.rows.tally().lost
        digests: NDArray[np.int64] = self.rows.kept("lost", count)["value"]
        return digests if count <= MOST_LOST else None

    def grow(self, part: Part | None) -> None:
        """Make room for more of what is full."""
        if part is not None:
            self.rows.grow(part.rows, _MORE)
            return
        tally = self.rows.tally()
        counts = {name: getattr(tally, name) for name in ("truths", "poses", "motions", "driven", "arrivals")}
        full = [name for name, count in counts.items() if count + self.rows.window > self.rows.size(name)]
        self.rows.grow(tuple(full), self.rows.window)

    def begin(self, part: Part) -> None:
        """Begin with a node, when it did anything first."""
        rows = self.repeats(part)
        done = load(Repeats, rows, 0)
        store(rows, 0, done._replace(begun=True))
        if part is ESTIMATES:
            self.nodes.estimating = self.nodes.estimator.rows_only(done.begin_ns)
        else:
            self.nodes.deciding = self.nodes.controller.rows_only(done.begin_ns)

    def trial(self, part: Part) -> Trial | None:
        """Go back to before the last output, for a node that begins there; None for the very first."""
        rows, tally = self.repeats(part), self.rows.tally()
        done = load(Repeats, rows, 0)
        if done.outputs == 1:
            return None
        kept = {part.rows[0]: self.rows.kept(part.rows[0], done.kept)[done.kept_before :].copy()}
        if part is DECIDES:
            kept["sent"] = self.rows.kept("sent", tally.sent)[done.sent_before :].copy()
            store(self.rows.tallies, 0, tally._replace(sent=done.sent_before))
        before = done._replace(
            next=done.next - 1,
            outputs=done.outputs - 1,
            kept=done.kept_before,
            missing=done.missing_before,
            computed_ns=done.before_ns,
            begun=False,
        )
        store(rows, 0, before)
        state = self.nodes.estimating if part is ESTIMATES else self.nodes.deciding
        return Trial(state, done, tally.sent, kept)

    def undo(self, part: Part, trial: Trial) -> None:
        """Have back what there was before a trial."""
        begins = {part.rows[0]: trial.done.kept_before, "sent": trial.done.sent_before}
        for name, rows in trial.rows.items():
            begin = begins[name]
            columns_of(self.rows.rows[name])[begin : begin + len(rows)] = rows
        store(self.repeats(part), 0, trial.done)
        store(self.rows.tallies, 0, self.rows.tally()._replace(sent=trial.sent))
        if isinstance(trial.state, EstimatorState):
            self.nodes.estimating = trial.state
        else:
            self.nodes.deciding = trial.state

    def differs(self, part: Part) -> None:
        """Note that the last output does not come out again."""
        done, wrong = load(Repeats, self.repeats(part), 0), self.wrong[part.node]
        wrong.append(done.outputs - 1)
        if len(wrong) == 1 and done.outputs > 1:
            self._gap_s[part.node] = (done.computed_ns - done.before_ns) * 1e-9

    def look(self) -> None:
        """Note what the nodes find to be wrong by now."""
        nodes = self.nodes
        estimated, decided = (
            load(Repeats, each, 0).computed_ns for each in (self.rows.estimating, self.rows.deciding)
        )
        now = {nodes.estimator.name: nodes.estimator.findings(nodes.estimating, estimated)}
        if self._decides:
            now[nodes.controller.name] = nodes.controller.findings(nodes.deciding, decided)
        self._found = all_found([self._found, now])

    def result(
        self,
        sides: Sequence[tuple[int, bytes]],
        reports: Mapping[str, Mapping[str, str]],
        found: Mapping[str, Findings],
        troubles: Mapping[str, Sequence[Trouble]],
    ) -> KeptReplay:
        """What was kept of it, orders to change sides, and what nodes reported and found, and when."""
        rows, tally = self.rows, self.rows.tally()
        estimating, deciding = load(Repeats, rows.estimating, 0), load(Repeats, rows.deciding, 0)
        arrivals = rows.kept("arrivals", tally.arrivals)
        kept = Kept(
            estimates=rows.kept("estimates", estimating.kept),
            commands=rows.kept("commands", deciding.kept),
            truths=rows.kept("truths", tally.truths),
            arrivals=arrivals[np.argsort(arrivals["receive_ns"], kind="stable")],
            poses=rows.kept("poses", tally.poses),
            motions=rows.kept("motions", tally.motions),
            sides=sides,
            reports=reports,
            stopped_ns=None if tally.stopped_ns == NEVER else tally.stopped_ns,
            found=found,
            troubles=troubles,
        )
        state = self.nodes.estimating
        if not self.same:
            return KeptReplay(
                self.link,
                kept,
                state.taken,
                state.refused,
                missing_inputs=estimating.missing,
                noise_scale=state.noise_scale,
                found=self._found,
            )
        return KeptReplay(
            self.link,
            kept,
            state.taken,
            state.refused,
            parity={
                "estimates": self._parity(ESTIMATES, estimating.outputs, set(), 0),
                "commands": self._parity(DECIDES, deciding.outputs, *self._driven()),
            },
            missing_inputs=estimating.missing + deciding.missing,
            restarts=self.restarts,
            noise_scale=state.noise_scale,
            found=self._found,
        )

    def _parity(self, part: Part, compared: int, also: set[int], unrecorded: int) -> Parity:
        wrong = {*self.wrong[part.node], *also}
        first = min(wrong, default=None)
        return Parity(compared, len(wrong), first, unrecorded, self._gap_before(part, first))

    def _gap_before(self, part: Part, first: int | None) -> float:
        """For how long nothing was recorded before the first output that differs."""
        wrong = self.wrong[part.node]
        if not first:
            return 0.0
        if wrong and wrong[0] == first:
            return self._gap_s[part.node]
        times = self.rows.kept("commands", load(Repeats, self.rows.deciding, 0).kept)["issued_ns"]
        return float(times[first] - times[first - 1]) * 1e-9

    def _driven(self) -> tuple[set[int], int]:
        """Outputs with which something else went to the robot than was logged, and how much is not logged."""
        tally = self.rows.tally()
        sent, driven = self.rows.kept("sent", tally.sent), self.rows.kept("driven", tally.driven)["digest"]
        both = min(len(sent), len(driven))
        apart = np.flatnonzero(sent["digest"][:both] != driven[:both])
        same = int(apart[0]) if len(apart) else both
        pairs = zip(sent["digest"][same:].tolist(), sent["place"][same:].tolist(), strict=True)
        return compare_in_order(list(pairs), driven[same:].tolist())


def _heard(topic: str, heard: Collection[str], numbers: Mapping[str, int]) -> int:
    return numbers[topic] if topic in heard else NOT_WANTED
