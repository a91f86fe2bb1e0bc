from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.errors import UsageError
from hil.log.reader import read_log
from hil.recordings.pair_log import Recorded, known_rows, planar_placements, write_pair
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import encode, header

SCENARIO = load_scenario("turtlebot3")
NAN = math.nan
T_NS = np.array([5, 1_000_000_007, 2_000_000_000, 3_999_999_999], dtype=np.int64)
LEADER = np.array([[0.1, 0.2, 0.3], [NAN, NAN, NAN], [1.0, -2.0, 3.0], [NAN, NAN, NAN]])
FOLLOWER = np.array([[0.4, 0.5, 0.6], [1.4, 1.5, 1.6], [NAN, NAN, NAN], [NAN, NAN, NAN]])
MOTION = np.array([[0.1, 0.2], [NAN, NAN], [0.3, 0.4], [NAN, 1.0]])
TRUTH = np.column_stack([np.arange(4.0), *[np.full(4, NAN)] * 9])
TRUTH[1] = NAN


def recorded(*, commanded: bool = False) -> Recorded:
    led, follows = (planar_placements(*poses.T) for poses in (LEADER, FOLLOWER))
    return Recorded(T_NS, led, follows, MOTION, None, TRUTH, commanded)


def written(path: Path, rows: Recorded) -> list[tuple[str, int, bytes]]:
    write_pair(path, rows, SCENARIO, {"file": "lab.csv"})
    names = ("follower/odom", "follower/leader_sighting", topics.RIGID_BODIES, topics.TRUTH)
    return [(each.topic, each.log_ns, each.payload) for each in read_log(path).records(names)]


def expected(row: int) -> dict[str, tuple[str, int, bytes]]:
    """What the general codec makes of a row."""
    t_ns = int(T_NS[row])
    bodies = [
        (name, Pose(*poses[row].tolist()))
        for name, poses in (("leader", LEADER), ("follower", FOLLOWER))
        if np.isfinite(poses[row]).all()
    ]
    motion = odometry_message(t_ns, "follower", Pose(0.0, 0.0, 0.0), Motion(*MOTION[row].tolist()))
    truth = msg.Truth(header(t_ns, "world"), row, *TRUTH[row].tolist())
    frame = frame_message(t_ns, row, bodies)
    return {
        "odometry": ("follower/odom", t_ns, encode(motion)),
        "frame": (topics.RIGID_BODIES, t_ns, encode(frame)),
        "truth": (topics.TRUTH, t_ns, encode(truth)),
    }


@pytest.mark.parametrize("commanded", [False, True])
def test_rows_are_the_messages_that_the_general_codec_writes(commanded: bool, tmp_path: Path) -> None:
    found = written(tmp_path / "log.mcap", recorded(commanded=commanded))
    first = ["frame", "odometry", "truth"] if commanded else ["odometry", "frame", "truth"]
    order = [(0, first), (1, ["frame"]), (2, first), (3, ["truth"])]
    assert found == [expected(row)[kind] for row, kinds in order for kind in kinds]
    assert read_log(tmp_path / "log.mcap").metadata["source"] == {"file": "lab.csv"}


def test_sightings_are_written_by_the_follower(tmp_path: Path) -> None:
    seen = np.array([[0.5, -0.1], [NAN, 0.2], [0.6, 0.3], [0.7, 0.4]])
    found = written(tmp_path / "log.mcap", Recorded(T_NS, sighting=seen))
    assert found == [
        (
            "follower/leader_sighting",
            int(T_NS[row]),
            encode(msg.RangeBearing(header(int(T_NS[row]), "follower"), *seen[row].tolist())),
        )
        for row in (0, 2, 3)
    ]


def test_many_rows_keep_their_order_and_values(tmp_path: Path) -> None:
    count = 10_000
    t_ns = np.arange(count, dtype=np.int64) * 1_000_000
    motion = np.column_stack([np.arange(count) * 1e-4, -np.arange(count) * 1e-3])
    found = written(tmp_path / "log.mcap", Recorded(t_ns, motion=motion))
    assert [at_ns for _, at_ns, _ in found] == t_ns.tolist()
    for row in (0, 4095, 4096, count - 1):
        message = odometry_message(
            int(t_ns[row]), "follower", Pose(0.0, 0.0, 0.0), Motion(*motion[row].tolist())
        )
        assert found[row][2] == encode(message)


def test_a_log_that_exists_is_kept(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(b"precious")
    with pytest.raises(UsageError, match="exists already"):
        write_pair(tmp_path / "log.mcap", recorded(), SCENARIO, {})
    assert (tmp_path / "log.mcap").read_bytes() == b"precious"


def test_nothing_is_left_of_an_import_that_breaks_down(tmp_path: Path) -> None:
    before_1970 = Recorded(np.array([-5], dtype=np.int64), motion=np.zeros((1, 2)))
    with pytest.raises(struct.error):
        write_pair(tmp_path / "log.mcap", before_1970, SCENARIO, {})
    assert not (tmp_path / "log.mcap").exists()


@given(st.lists(st.floats(-4.0, 4.0), min_size=1))
def test_headings_become_quaternions_about_z(headings: list[float]) -> None:
    theta = np.array(headings)
    found = planar_placements(theta, -theta, theta)
    assert known_rows(found).all()
    back = 2.0 * np.arctan2(found[:, 5], found[:, 6])
    assert np.allclose(np.exp(1j * back), np.exp(1j * theta), atol=1e-12)
    assert not found[:, 2:5].any()
