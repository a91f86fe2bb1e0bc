"""A replay in one pass gives what a replay message by message does: parity, counts, and every figure."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formation.kernel import interpreted
from formation.records import columns_of
from hil.judge.own_motion import judge_own_motion
from hil.judge.replay_verdict import Played, run_data_of_replay, why_not_same
from hil.judge.summary import summarise
from hil.log.events import logged_events
from hil.log.reader import Log, Record, read_log
from hil.log.writer import LogWriter
from hil.nodes.link_nodes import estimator_node
from hil.replay.kept import KeptReplay
from hil.replay.log_replay import LogReplay, kept_replays
from hil.replay.replay_entries import go_on
from hil.replay.rerun import linked, replay_link
from hil.scenario.files import with_overrides
from hil.scenario.links import Link
from hil.wire import topics
from tests.hil.replay.test_rerun import Change, flipped, lockstep_log, nth, rewritten

ESTIMATE, COMMAND, DRIVE = "follower/leader_estimate", "follower/command", "follower/cmd_vel"
ROUGH = ("mocap.loss=0.05", "mocap.jitter_s=0.02", "run.evaluate_from_s=1.0")
CASES: dict[str, tuple[str, ...]] = {
    "rough": ROUGH,
    "ukf": (*ROUGH, "estimator.kind=ukf"),
    "own clock": (*ROUGH, "mocap.clock_offset_s=3.0", "estimator.clock=estimated"),
    "fused": ("estimator.own_motion=fused", 'mocap.faults=[{kind="freeze", at_s=1.0, duration_s=0.3}]'),
    "body": ("estimator.front_end=body", "controller.command_type=Twist"),
    "zero odometry": ('robot.odometry_faults=[{kind="zero", at_s=0.2}]', "mocap.jitter_s=0.02"),
    "silent odometry": ('robot.odometry_faults=[{kind="silent", at_s=0.5}]', "estimator.front_end=body"),
    "nan in odometry": ('robot.odometry_faults=[{kind="nan", at_s=0.5}]',),
    "coasting": ("mocap.loss=0.97",),
    "told": ("controller.law=ideal", "formation.change_sides_at_s=[1.0]"),
}


@pytest.fixture(scope="module")
def rough_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return lockstep_log(tmp_path_factory.mktemp("rough"), *ROUGH)


def in_one_pass(log: Log, links: Sequence[tuple[Link, Link]] | None = None) -> KeptReplay:
    found = kept_replays(log, linked(log) if links is None else links)
    assert found is not None
    return found[0]


def figures(log: Log, played: Played) -> dict[str, Any]:
    summary = summarise(run_data_of_replay(log, played, from_s=0.5, to_s=2.0))
    return summary | {"own_motion": judge_own_motion(log, played)}


def same_as_by_messages(log: Log, links: Sequence[tuple[Link, Link]] | None = None) -> KeptReplay:
    """Replay both ways, and hold them to be the same."""
    (link, was), *_ = linked(log) if links is None else links
    kept, wanted = in_one_pass(log, [(link, was)]), replay_link(log, link, was)
    assert kept.parity == wanted.parity
    assert (kept.taken, kept.refused) == (wanted.estimator.taken, wanted.estimator.refused)
    assert kept.missing_inputs == wanted.missing_inputs
    assert {name: n for name, n in kept.restarts.items() if n} == {
        name: n for name, n in wanted.restarts.items() if n
    }
    assert why_not_same(log, kept) == why_not_same(log, wanted)
    assert kept.kept.estimates["v1"].tolist() == [each.v1 for each in wanted.estimates]
    assert kept.kept.commands["v2"].tolist() == [each.v2 for each in wanted.commands]
    assert figures(log, kept) == figures(log, wanted)
    return kept


@pytest.mark.parametrize("overrides", CASES.values(), ids=CASES.keys())
def test_every_figure_is_that_of_a_replay_by_messages(overrides: tuple[str, ...], tmp_path: Path) -> None:
    kept = same_as_by_messages(lockstep_log(tmp_path, *overrides))
    assert kept.parity["estimates"].compared > 20
    assert kept.parity["commands"].compared > 20
    assert not sum(parity.mismatched for parity in kept.parity.values())


@pytest.mark.parametrize(
    ("topic", "number", "change"),
    [
        (ESTIMATE, 100, flipped(44)),
        (COMMAND, 100, flipped(44)),
        (COMMAND, 1, flipped(44)),
        (DRIVE, 100, flipped(-48)),
        (DRIVE, 90, lambda record: None),
        (ESTIMATE, 90, lambda record: None),
    ],
)
def test_what_was_changed_is_found_the_same_way(
    topic: str, number: int, change: Change, rough_log: Log, tmp_path: Path
) -> None:
    kept = same_as_by_messages(rewritten(rough_log, tmp_path / "bad.mcap", nth(topic, number, change)))
    assert sum(each.mismatched + each.unrecorded for each in kept.parity.values())


def test_another_estimator_gets_the_same_inputs(rough_log: Log) -> None:
    ((link, was),) = linked(rough_log)
    other = Link(with_overrides(link.scenario, ["estimator.kind=ukf"]))
    assert same_as_by_messages(rough_log, [(other, was)]).parity == {}


def test_an_estimator_that_was_started_again_is_told(rough_log: Log, tmp_path: Path) -> None:
    ((link, _),) = linked(rough_log)
    node, state, log = estimator_node(link), None, tmp_path / "again.mcap"
    events = list(logged_events(rough_log, node.subscribes))
    types = rough_log.topics
    with LogWriter(log, rough_log.metadata) as out:
        for number, (event, now_ns) in enumerate(events):
            if state is None or number == len(events) // 2:
                state = node.begin(now_ns)
            out.write(event.topic, types[event.topic], event.payload, now_ns, now_ns)
            state, sent = node.step(state, event, now_ns)
            for message in sent:
                out.write(message.topic, message.typename, message.payload, now_ns, now_ns)
    kept = same_as_by_messages(read_log(log))
    assert kept.restarts["estimator"] == 1
    assert kept.parity["estimates"].mismatched == 0


def moved(topic: str, later_ns: int) -> Change:
    def move(record: Record) -> Record:
        if record.topic != topic:
            return record
        return dataclasses.replace(record, log_ns=record.log_ns + later_ns)

    return move


def test_inputs_that_were_logged_after_what_rests_on_them_are_waited_for(
    rough_log: Log, tmp_path: Path
) -> None:
    log = rewritten(rough_log, tmp_path / "later.mcap", moved("follower/odom", 10**9))
    kept = in_one_pass(log)
    assert kept.missing_inputs == 0
    assert not sum(parity.mismatched for parity in kept.parity.values())


@pytest.mark.parametrize("later_s", [-9, 9])
def test_an_order_that_is_far_off_is_left_to_the_replay_by_messages(
    later_s: int, rough_log: Log, tmp_path: Path
) -> None:
    log = rewritten(rough_log, tmp_path / "far.mcap", moved("follower/odom", later_s * 10**9))
    kept = kept_replays(log, linked(log))
    assert kept is None or not sum(parity.mismatched for parity in kept[0].parity.values())


def test_a_stop_that_is_not_there_at_all_is_missing(rough_log: Log, tmp_path: Path) -> None:
    log = rewritten(rough_log, tmp_path / "less.mcap", lambda r: None if r.topic == topics.STOP else r)
    assert same_as_by_messages(log).missing_inputs == 1


def test_an_estimator_that_lacks_inputs_is_left_to_the_replay_by_messages(
    rough_log: Log, tmp_path: Path
) -> None:
    """There it is told whether they were edited."""
    log = rewritten(rough_log, tmp_path / "none.mcap", nth(topics.RIGID_BODIES, 60, lambda record: None))
    assert kept_replays(log, linked(log)) is None


def test_a_follower_of_a_chain_is_replayed_beside_the_others(tmp_path: Path) -> None:
    log = lockstep_log(tmp_path, "chain.agents=3")
    found = kept_replays(log, linked(log))
    assert found is not None
    assert [each.link.follower for each in found] == [link.follower for link, _ in linked(log)]
    for kept, (link, was) in zip(found, linked(log), strict=True):
        wanted = replay_link(log, link, was)
        assert kept.parity == wanted.parity
        assert summarise(run_data_of_replay(log, kept)) == summarise(run_data_of_replay(log, wanted))


class PlainReplay(LogReplay):
    """The same in plain Python."""

    def _go_on(self) -> None:
        pairs: Any = [each.rows.record() for each in self.followers]
        windows: Any = [self.window.record]
        interpreted(go_on)(windows, pairs, self._stages, self._records)
        self._see_asides()


def test_compiled_and_plain_replay_keep_the_same_to_the_last_bit(tmp_path: Path) -> None:
    log = lockstep_log(tmp_path, "run.duration_s=0.3", "mocap.rate_hz=40", "mocap.loss=0.1")
    bad = rewritten(log, tmp_path / "bad.mcap", nth(ESTIMATE, 12, flipped(44)))
    found: list[KeptReplay] = []
    for kind in (LogReplay, PlainReplay):
        replay = kind(bad, linked(bad))
        replay.run()
        found += replay.results()
    compiled, plain = found
    assert (compiled.parity, compiled.missing_inputs) == (plain.parity, plain.missing_inputs)
    assert compiled.parity["estimates"].mismatched == 1
    for name in ("estimates", "commands", "truths", "arrivals", "poses", "motions"):
        one, other = (columns_of(getattr(each.kept, name)) for each in found)
        assert len(one) > 0
        for column in one.dtype.names or ():
            assert np.array_equal(one[column], other[column], equal_nan=one[column].dtype.kind == "f")
