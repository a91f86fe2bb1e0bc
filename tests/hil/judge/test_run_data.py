from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.judge.frames import Frames
from hil.judge.run_data import RunData, Span, evaluation_span, run_data_of_log, run_span
from hil.judge.summary import summarise
from hil.log.metadata import log_metadata
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import digest
from hil.wire.message_types import Consumed, RigidBodies
from hil.wire.messages import decode_as, encode, header, to_ns, to_time, typename_of

SECOND = 1_000_000_000


def test_a_log_gives_back_what_the_run_did(short_log: Log) -> None:
    run_data = run_data_of_log(short_log)
    assert (run_data.mode, run_data.scenario.run.seed) == ("lockstep", 7)
    assert run_data.motion_since_ns == run_data.zero_ns
    assert run_span(run_data).seconds == pytest.approx(6.0)
    assert run_data.stopped_ns == run_span(run_data).to_ns
    assert run_data.taken["frames"] == len(run_data.estimates)
    assert run_data.taken["used"] + run_data.refused.get("gated", 0) == run_data.taken["frames"]
    assert run_data.log is not None
    assert run_data.log.messages == short_log.messages
    assert run_data.log.bytes == short_log.path.stat().st_size


def test_every_captured_frame_is_received_or_lost(short_log: Log) -> None:
    run_data = run_data_of_log(short_log)
    assert run_data.frames is not None
    assert run_data.frames.received == run_data.taken["frames"]
    captured = [to_ns(each.header.stamp) for each in run_data.truth]
    first, last = run_data.frames.captures_ns[0], run_data.frames.captures_ns[-1]
    assert run_data.frames.published == sum(first <= moment <= last for moment in captured)
    assert 0.01 < 1.0 - run_data.frames.received / run_data.frames.published < 0.1


def frames_log(path: Path, run_data: RunData, numbers: Sequence[int], got: Sequence[int]) -> Log:
    """A log without truth of frames with the given numbers, each sent twice, with receipts for some."""
    frames = {number: RigidBodies(header(number * SECOND, "mocap"), number, []) for number in numbers}
    payloads = {number: encode(frame) for number, frame in frames.items()}
    receipts = [Consumed(digest(topics.RIGID_BODIES, payloads[number]), to_time(0)) for number in got]
    estimate = replace(run_data.estimates[0], consumed=receipts)
    with LogWriter(path, log_metadata(run_data.scenario, "live")) as log:
        for number, payload in payloads.items():
            for _ in range(2):
                log.write(topics.RIGID_BODIES, typename_of(RigidBodies), payload, number, number)
        log.write("follower/leader_estimate", typename_of(estimate), encode(estimate), 99, 99)
    return read_log(path)


@pytest.mark.parametrize(
    ("numbers", "got", "published"),
    [
        ([10, 11, 12, 13, 14], [10, 11, 13, 14], 5),  # one did not arrive
        ([10, 11, 12, 15, 16], [10, 11, 12, 15, 16], 7),  # two never left the mocap
        ([10, 12, 14, 18, 20], [10, 12, 14, 18, 20], 6),  # a mocap that sends every second frame
        ([10, 11, 12, 13, 14], [11, 12, 13], 3),  # before the first and after the last does not count
    ],
)
def test_frames_without_truth_are_counted_by_their_numbers(
    tmp_path: Path, exact_run_data: RunData, numbers: list[int], got: list[int], published: int
) -> None:
    log = frames_log(tmp_path / "run.mcap", exact_run_data, numbers, got)
    assert run_data_of_log(log).frames == Frames(published, [number * SECOND for number in got])


def test_a_log_that_tells_no_scenario_needs_one(tmp_path: Path, exact_run_data: RunData) -> None:
    with LogWriter(tmp_path / "bare.mcap", {}):
        pass
    log = read_log(tmp_path / "bare.mcap")
    with pytest.raises(UsageError, match="scenario"):
        run_data_of_log(log)
    found = run_data_of_log(log, exact_run_data.scenario)
    assert (len(found.estimates), found.frames, found.motion_since_ns) == (0, None, None)


def test_a_run_ends_with_the_stop_or_its_duration(exact_run_data: RunData) -> None:
    start = exact_run_data.zero_ns
    assert run_span(exact_run_data).seconds == pytest.approx(4.0, abs=1e-6)
    stopped = replace(exact_run_data, stopped_ns=start + 2 * SECOND)
    assert run_span(stopped) == Span(start, start + 2 * SECOND)
    crashed = replace(
        exact_run_data, estimates=exact_run_data.estimates[:60], truth=exact_run_data.truth[:90]
    )
    assert run_span(crashed).to_ns == to_ns(exact_run_data.truth[89].header.stamp)


def test_what_is_judged(exact_run_data: RunData) -> None:
    start = exact_run_data.zero_ns
    assert evaluation_span(exact_run_data).from_ns == start + SECOND
    asked = replace(exact_run_data, evaluate_from_ns=start + 7, evaluate_to_ns=start + 9)
    assert evaluation_span(asked) == Span(start + 7, start + 9)
    short = replace(exact_run_data, stopped_ns=start + SECOND // 2)
    assert evaluation_span(short) == Span(start + SECOND // 4, start + SECOND // 2)
    recorded = replace(exact_run_data, motion_since_ns=None, stopped_ns=None)
    last = to_ns(exact_run_data.estimates[-1].header.stamp)
    assert evaluation_span(recorded) == Span(start + SECOND, last)


def test_what_cannot_be_is_left_out_whoever_has_sent_it(short_log: Log, tmp_path: Path) -> None:
    never = replace(header(1, ""), stamp=replace(to_time(1), sec=-1))
    estimate = decode_as(next(short_log.records(["follower/leader_estimate"])).payload, msg.LeaderEstimate)
    command = decode_as(next(short_log.records(["follower/command"])).payload, msg.Command)
    nonsense: dict[str, list[msg.Message]] = {
        "follower/leader_estimate": [
            replace(estimate, header=never),
            replace(estimate, status=77),
            replace(estimate, v1=math.inf),
        ],
        "follower/command": [replace(command, capture=never.stamp)],
        "truth": [msg.Truth(never, 1, *[0.0] * 10), msg.Truth(header(1, ""), 1, *[math.inf] * 10)],
        "rigid_bodies": [msg.RigidBodies(never, 1, [])],
    }
    path = tmp_path / "more.mcap"
    with LogWriter(path, short_log.metadata) as log:
        for record in short_log.records():
            log.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
        for topic, messages in nonsense.items():
            for message in messages:
                assert short_log.end_ns is not None
                log.write(topic, typename_of(message), encode(message), short_log.end_ns, short_log.end_ns)
    wanted, found = (summarise(run_data_of_log(each)) for each in (short_log, read_log(path)))
    assert wanted.pop("log") != found.pop("log")
    assert found == wanted


def test_counts_that_are_none_are_left_out(tmp_path: Path) -> None:
    odd = {"taken.used": "many", "taken.frames": "9" * 5000, "refused.gated": "-1", "motion_since_ns": "soon"}
    values = [msg.KeyValue(key=key, value=value) for key, value in odd.items()]
    nodes = [
        msg.DiagnosticStatus(level=0, name=name, message="", hardware_id="", values=values)
        for name in ("abreast/estimator", "abreast/emulator")
    ]
    report = msg.DiagnosticArray(header=header(1, ""), status=nodes)
    path = tmp_path / "odd.mcap"
    with LogWriter(path, log_metadata(load_scenario("turtlebot3"), "live")) as log:
        log.write("diagnostics", typename_of(report), encode(report), 1, 1)
    run_data = run_data_of_log(read_log(path))
    assert (run_data.taken, run_data.refused, run_data.motion_since_ns) == ({}, {}, None)
