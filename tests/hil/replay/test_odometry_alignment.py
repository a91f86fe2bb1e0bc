from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from formation.pose import Motion, Pose, advance
from hil.command_line import main
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.log.metadata import log_metadata
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.odometry_alignment import judge_own_motion
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import encode, typename_of

START_NS = 1_700_000_000_000_000_000
STEP_NS = 16_000_000
LATE_NS = 13 * STEP_NS
SCENARIO = load_scenario("turtlebot3")


def command(k: int) -> Motion:
    """What the robot was told in step k."""
    t = k * STEP_NS * 1e-9
    return Motion(0.07 + 0.02 * math.sin(0.9 * t), 0.4 * math.sin(1.7 * t) + 0.1 * math.sin(0.4 * t))


def logged(path: Path, *, moves: bool = True, mocap: bool = True) -> Log:
    """Half a minute of a follower that does nine tenths of what it was told, 208 ms later."""
    generator, follower = np.random.default_rng(8), Pose(0.0, 0.0, 3.0)
    leader = Pose(1.0, 1.0, 0.0)
    with LogWriter(path, log_metadata(SCENARIO, "import")) as log:

        def write(topic: str, message: msg.Message, at_ns: int) -> None:
            log.write(topic, typename_of(message), encode(message), at_ns, at_ns)

        for k in range(1900):
            at_ns, shake = START_NS + k * STEP_NS, generator.normal(size=3) * [7e-4, 7e-4, 8e-3]
            sample = command(k) if moves else Motion(0.0, 0.0)
            write("follower/odom", odometry_message(at_ns, "follower", Pose(0.0, 0.0, 0.0), sample), at_ns)
            if mocap:
                seen = Pose(follower.x + shake[0], follower.y + shake[1], follower.theta + shake[2])
                pair = [("leader", leader), ("follower", seen)]
                write(topics.RIGID_BODIES, frame_message(at_ns, k, pair), at_ns)
            done = command(k - 13) if moves else sample
            follower = advance(follower, 0.9 * done.v, 0.9 * done.u, STEP_NS * 1e-9)
        write("follower/odom", odometry_message(0, "follower", leader, Motion(math.nan, 0.0)), at_ns)
    return read_log(path)


def test_delay_and_scales_of_commands_are_found(tmp_path: Path) -> None:
    found = judge_own_motion(logged(tmp_path / "run.mcap"), SCENARIO)
    assert found["delay_s"] == pytest.approx(LATE_NS * 1e-9, abs=0.02)
    assert found["scale_v"] == pytest.approx(0.9, abs=0.02)
    assert found["scale_u"] == pytest.approx(0.9, abs=0.02)
    assert 0.0 < found["delay_s_sd"] < 0.02


def test_what_cannot_be_known_is_absent(tmp_path: Path) -> None:
    assert judge_own_motion(logged(tmp_path / "still.mcap", moves=False), SCENARIO) == {}
    assert judge_own_motion(logged(tmp_path / "blind.mcap", mocap=False), SCENARIO) == {}


@pytest.mark.slow
def test_a_replay_tells_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logged(tmp_path / "run.mcap")
    with pytest.raises(SystemExit) as done:
        main(["replay", str(tmp_path / "run.mcap"), "--json"])
    assert done.value.code == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["own_motion"]["delay_s"] == pytest.approx(LATE_NS * 1e-9, abs=0.02)
