"""A log that begins after its estimator did says so, and is never called equal."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

from hil.judge.late_recorder import late_recorder
from hil.judge.replay_verdict import why_not_same
from hil.log.described_log import DescribedLog
from hil.log.description import ORIGIN
from hil.log.reader import Log, Record, read_log
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import encode, to_time

LINK = Link(load_scenario("turtlebot3"))


def recorded_from(
    log: Log, from_ns: int, path: Path, first: bytes | None = None, without: tuple[str, ...] = ()
) -> Log:
    """The same log by a recorder that came at a time. ``first``: what its first estimate is instead."""

    def heard(record: Record) -> bool:
        return record.log_ns >= from_ns and record.topic not in (topics.LOG, *without)

    metadata = {name: dict(values) for name, values in log.metadata.items() if name != ORIGIN}
    with DescribedLog(path, metadata) as writer:
        for record in filter(heard, log.records()):
            payload = record.payload
            if record.topic == "follower/leader_estimate" and first is not None:
                payload, first = first, None
            writer.write(record.topic, record.typename, payload, record.log_ns, record.publish_ns)
    return read_log(path)


def test_a_recorder_that_comes_late_is_named_as_the_cause(short_log: Log, tmp_path: Path) -> None:
    assert short_log.start_ns is not None
    log = recorded_from(short_log, short_log.start_ns + 2_000_000_000, tmp_path / "late.mcap")
    played = replay(log)
    assert played.mismatched > 100
    said = why_not_same(log, played)
    assert "the recorder came later than the estimator, which had used " in said
    assert "start the recorder first" in said
    assert "recorder's scenario" not in said


def test_inputs_from_before_the_log_are_enough_to_tell(short_log: Log, tmp_path: Path) -> None:
    # The odometry and the ticks between two frames are consumed before the estimate that names them.
    (second,) = itertools.islice(short_log.records(["follower/leader_estimate"]), 101, 102)
    told = short_log.decode(second)
    assert isinstance(told, LeaderEstimate)
    moved = dataclasses.replace(told.consumed[0], received=to_time(second.log_ns - 10_000_000))
    early = encode(dataclasses.replace(told, consumed=[moved, *told.consumed[1:]]))
    log = recorded_from(short_log, second.log_ns, tmp_path / "late.mcap", early, (topics.DIAGNOSTICS,))
    assert "had used inputs 10 ms before anything was recorded: start the recorder" in late_recorder(
        log, LINK
    )


def test_of_a_whole_log_nobody_says_so(short_log: Log) -> None:
    assert late_recorder(short_log, LINK) == ""
    assert why_not_same(short_log, replay(short_log)) == ""
