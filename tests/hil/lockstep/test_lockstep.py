from __future__ import annotations

import math
from pathlib import Path

import pytest

from hil.errors import CheckFailedError
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import Command, LeaderEstimate, Truth
from hil.wire.messages import decode_as, to_ns

WEATHER = ["mocap.loss=0.05", "mocap.jitter_s=0.02"]


def run(folder: Path, name: str, *overrides: str) -> Path:
    path = folder / f"{name}.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=8", *overrides]), path)
    return path


def payloads(log: Log, topic: str) -> list[bytes]:
    return [record.payload for record in log.records([topic])]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tmp_path_factory.mktemp("lockstep"), "first", "run.seed=7", *WEATHER)


@pytest.fixture(scope="module")
def log(first: Path) -> Log:
    return read_log(first)


def test_the_same_seed_gives_the_same_bytes(first: Path, tmp_path: Path) -> None:
    assert run(tmp_path, "again", "run.seed=7", *WEATHER).read_bytes() == first.read_bytes()


def test_another_seed_gives_other_bytes(first: Path, tmp_path: Path) -> None:
    other = run(tmp_path, "other", "run.seed=8", "run.duration_s=1", *WEATHER)
    wanted, found = (payloads(read_log(path), topics.RIGID_BODIES) for path in (first, other))
    assert not set(wanted[30:90]) & set(found)


def test_the_follower_comes_to_drive_abreast(log: Log) -> None:
    truths = [decode_as(payload, Truth) for payload in payloads(log, topics.TRUTH)]
    before, at_end = truths[0], truths[-100]
    gaps = [math.hypot(t.leader_x - t.follower_x, t.leader_y - t.follower_y) for t in (before, at_end)]
    assert gaps[0] == pytest.approx(0.832, abs=1e-3)
    assert 0.15 < gaps[1] < 0.4


def test_the_run_ends_in_standstill(log: Log) -> None:
    last = decode_as(payloads(log, topics.TRUTH)[-1], Truth)
    assert max(abs(last.v1), abs(last.v2)) < 2e-3
    assert max(abs(last.u1), abs(last.u2)) < 2e-2
    commands = [decode_as(payload, Command) for payload in payloads(log, "follower/command")]
    assert commands[-1].stop == "stopped"


def test_time_in_the_log_runs_forward_from_the_simulated_epoch(log: Log) -> None:
    times = [record.log_ns for record in log.records()]
    assert times == sorted(times)
    assert times[0] >= EPOCH_NS
    assert times[-1] < EPOCH_NS + 10 * 10**9


def test_estimates_are_made_from_frames_that_came_late_and_out_of_order(log: Log) -> None:
    estimates = [decode_as(p, LeaderEstimate) for p in payloads(log, "follower/leader_estimate")]
    ages = [to_ns(e.computed) - to_ns(e.header.stamp) for e in estimates]
    assert min(ages) >= 0
    assert max(ages) > 50_000_000


def test_without_any_frame_the_run_says_what_to_look_at(tmp_path: Path) -> None:
    with pytest.raises(CheckFailedError, match=r"mocap\.loss"):
        run(tmp_path, "blind", "mocap.loss=0.999999999")


@pytest.mark.parametrize("ahead_s", [0.002, 0.02, 0.049])
def test_a_motion_capture_that_is_a_little_ahead_of_the_host_drives_the_robot(
    ahead_s: float, tmp_path: Path
) -> None:
    # Message checks and guard share one tolerance: a frame that is used is one that may move the robot.
    overrides = {"run.duration_s": 2.0, "mocap.clock_offset_s": ahead_s, "mocap.latency_s": 0.001}
    run_lockstep(load_scenario("turtlebot3", overrides), tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap")
    stops = [decode_as(each.payload, Command).stop for each in log.records(["follower/command"])]
    driving = [place for place, stop in enumerate(stops) if not stop]
    first, last = driving[0], driving[-1]
    assert last - first > 100
    assert not any(stops[first : last + 1])
