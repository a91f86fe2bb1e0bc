"""Replay in one pass over a log: a window of its last seconds, compiled steps, rows for the judge."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from estimation.filters.filter import Filter
from formation.kernel import compiles
from formation.records import columns_of, load, row_of, rows_of, store
from hil.log.bulk import in_bulk
from hil.log.reader import Log, damaged
from hil.nodes.link_nodes import controller_node, estimator_node
from hil.replay.follower_replay import DECIDES, ESTIMATES, FollowerReplay, OddLogError, Part
from hil.replay.kept import KeptReplay
from hil.replay.node_reports import LastReports
from hil.replay.pair_desk import BEGINS, DIFFERS, DONE, ODD, ROOM, Pair, Repeats
from hil.replay.replay_entries import BROKEN, DECIDING, ESTIMATING, FULL, NOTHING, Stage, go_on
from hil.replay.window import TORN, Extent
from hil.replay.window_rows import WindowRows
from hil.scenario.certify import same_steps
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import typename_of
from hil.wire.topics import link_topics

_END_OF_TIME = 2**63 - 1
_SPAN_NS = 5_000_000_000
"""For how long in log time messages stay before the last output that was repeated."""

_MOST_BYTES = 1 << 27
"""Of messages that are kept for outputs to come; what is older then leaves."""


GoOn = Callable[[float], bool]


def kept_replays(
    log: Log, links: Sequence[tuple[Link, Link]], go_on: GoOn | None = None
) -> tuple[KeptReplay, ...] | None:
    """Replay each follower by its link as it is asked for, beside the log's own, in one pass over the log.

    None for what this way cannot do: logs without estimates, estimators that are not compiled or look at
    more than one message at a time, and logs in which something is not as live nodes leave it, an order that
    is off by seconds, say. ``go_on``: called now and then with the share of the log that is done; where it
    says no, the replay ends there. Raises :class:`UsageError` for a damaged log.
    """
    if not compiles() or not all(_may_be_kept(log, chosen) for chosen, _ in links):
        return None
    try:
        replay = LogReplay(log, links)
        whole = replay.run(go_on)
        return None if whole and replay.looks_back() else replay.results()
    except OddLogError:
        return None


def _may_be_kept(log: Log, link: Link) -> bool:
    given, estimate = link.scenario.estimator, link_topics(link).estimate
    if given.kind == "smoother" or given.certify or given.align_odometry:
        return False
    return log.topics.get(estimate) == typename_of(LeaderEstimate) and bool(log.counts.get(estimate))


class LogReplay:
    """A pass over a log, with all followers that are replayed."""

    def __init__(self, log: Log, links: Sequence[tuple[Link, Link]]) -> None:
        self.log = log
        nodes = [(estimator_node(chosen), controller_node(chosen)) for chosen, _ in links]
        if not all(isinstance(estimator.rules.step.filter, Filter) for estimator, _ in nodes):
            raise OddLogError
        hashed: set[str] = set()
        others: set[str] = {topics.DIAGNOSTICS, topics.STOP}
        self._sides: set[str] = set()
        for (chosen, _), (estimator, controller) in zip(links, nodes, strict=True):
            names = link_topics(chosen)
            hashed |= {*estimator.subscribes, *controller.subscribes, names.wanted}
            others |= {names.truth, names.command, names.estimate, names.side}
            self._sides.add(names.side)
        self._hashed = hashed
        self._topics = sorted(hashed | others)
        self._bulk = in_bulk(log, self._topics)
        aside = {topics.DIAGNOSTICS, *self._sides}
        self.window = WindowRows(self._topics, hashed, aside, self._bulk.topics)
        numbers = {topic: number for number, topic in enumerate(self._topics)}
        self.followers = [
            FollowerReplay(
                log, chosen, numbers, each, self.window.room, same=_same(chosen, own), tracks=len(links) == 1
            )
            for (chosen, own), each in zip(links, nodes, strict=True)
        ]
        self._pairs = rows_of(Pair, len(self.followers))
        self._stages = row_of(Stage(0, 0, NOTHING, False, DONE, 0, 0))
        self._records = b""
        self._reports = LastReports(log)
        self._orders: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in self._sides}
        for number in range(len(self.followers)):
            self._lend(number)

    def run(self, go_on: GoOn | None = None) -> bool:
        """Go through the log as long as is wished; whether to its end."""
        whole = True
        for batch in self._bulk.batches:
            self._take(Stage(0, batch.until_ns, NOTHING, False, DONE, 0, 0), batch.records)
            self._look()
            whole = go_on is None or batch.until_ns == _END_OF_TIME or go_on(self._share(batch.until_ns))
            if not whole:
                break
        self._take(Stage(0, _END_OF_TIME, NOTHING, True, DONE, 0, 0), b"")
        messages = load(Extent, self.window.extent, 0).messages
        self._take(Stage(0, _END_OF_TIME, messages, True, DONE, 0, 0), b"")
        self._look()
        return whole

    def _share(self, until_ns: int) -> float:
        """Share of the log that was logged before a time, as far as its index tells."""
        chunks = self.log.chunks
        span_ns = chunks[-1].last_ns - chunks[0].first_ns if chunks else 0
        return (until_ns - chunks[0].first_ns) / span_ns if span_ns > 0 else 0.0

    def _look(self) -> None:
        for follower in self.followers:
            follower.look()

    def results(self) -> tuple[KeptReplay, ...]:
        """What was kept. Raises :class:`OddLogError` where reports of nodes are none."""
        reports = self._reports.values()
        if reports is None:
            raise OddLogError
        found, troubles = self._reports.found(), self._reports.troubles()
        return tuple(
            each.result(self._orders.get(each.names.side, []), reports, found, troubles)
            for each in self.followers
        )

    def looks_back(self) -> bool:
        """Whether an input that was missing is in the log after all, too far from where it was needed."""
        if any(follower.lost is None or follower.lacks for follower in self.followers):
            return True
        lost = np.concatenate([np.asarray(follower.lost) for follower in self.followers])
        if not len(lost):
            return False
        bulk = in_bulk(self.log, self._topics)
        self.window = WindowRows(self._topics, self._hashed, (), bulk.topics)
        self._pairs = rows_of(Pair, 0)
        found = False
        for batch in bulk.batches:
            first = load(Extent, self.window.extent, 0).admitted
            self._take(Stage(0, batch.until_ns, first, False, DONE, 0, 0), batch.records)
            found = found or bool(np.isin(self.window.digests(), lost).any())
        return found

    def _take(self, stage: Stage, records: bytes) -> None:
        """Take records in and go on as far as they let."""
        self._records = records
        store(self._stages, 0, stage)
        self._go_on()
        while (stage := load(Stage, self._stages, 0)).why != DONE:
            if not self._is_seen_to(stage):
                self._go_on()

    def _go_on(self) -> None:
        go_on(self.window.lent, self._pairs, self._stages, self._records)
        self._see_asides()

    def _see_asides(self) -> None:
        for topic, log_ns, payload in self.window.asides():
            if topic == topics.DIAGNOSTICS:
                self._reports.hear(payload)
            else:
                self._orders[topic].append((log_ns, payload))

    def _is_seen_to(self, stage: Stage) -> bool:
        """See to why the steps stopped; whether they have gone on already."""
        if stage.why == ODD:
            raise OddLogError
        if stage.why == BROKEN:
            torn = "a record is longer than the chunk that it is in"
            raise damaged(self.log.path, torn if stage.what == TORN else "a message is of an unknown channel")
        if stage.why == FULL:
            self._make_room(stage)
            return False
        follower, part = self.followers[stage.pair], _PARTS.get(stage.what)
        gone_on = False
        if stage.why == ROOM or part is None:
            follower.grow(part)
        elif stage.why == BEGINS:
            follower.begin(part)
        elif stage.why == DIFFERS:
            gone_on = self._is_tried_again(stage, part)
        self._lend(stage.pair)
        return gone_on

    def _is_tried_again(self, stage: Stage, part: Part) -> bool:
        """Try an output that differs with a node that begins there; whether steps have gone on with it."""
        follower = self.followers[stage.pair]
        trial = follower.trial(part)
        if trial is None:
            follower.differs(part)
            return False
        self._go_on()
        follower.begin(part)
        self._lend(stage.pair)
        self._go_on()
        after = load(Stage, self._stages, 0)
        alone = load(Repeats, follower.repeats(part), 0).outputs == trial.done.outputs
        if alone and (after.why, after.what, after.pair) == (DIFFERS, stage.what, stage.pair):
            follower.undo(part, trial)
            follower.differs(part)
            return False
        follower.restarts[part.node] += 1
        return True

    def _make_room(self, stage: Stage) -> None:
        """Let messages leave that nobody needs any more, or make the window longer."""
        first = self._first_needed()
        if not self.window.is_half_free(first) and self.window.size < _MOST_BYTES:
            self.window.grow()
            for number, follower in enumerate(self.followers):
                follower.rows.lengthen_received(self.window.room)
                self._lend(number)
        elif not self.window.is_half_free(first):
            first = max(first, self._first_unused())
        store(self._stages, 0, stage._replace(first=first, pair=0))

    def _first_needed(self) -> int:
        """Number of the first message that an output to come may rest on."""
        needed = [part for each in self.followers for part in each.needed()]
        times = self.window.log_times()
        if not needed:
            return len(times)
        oldest = min(int(np.searchsorted(times, ns - _SPAN_NS)) for _, ns in needed)
        return min([oldest, *(place for place, _ in needed)])

    def _first_unused(self) -> int:
        """Number of the first message that is still to be looked at itself."""
        return min([len(self.window.log_times()), *(p for each in self.followers for p, _ in each.needed())])

    def _lend(self, number: int) -> None:
        columns_of(self._pairs)[number] = self.followers[number].rows.lent()[0]


_PARTS = {ESTIMATING: ESTIMATES, DECIDING: DECIDES}


def _same(chosen: Link, own: Link) -> bool:
    return same_steps(chosen.scenario, own.scenario)
