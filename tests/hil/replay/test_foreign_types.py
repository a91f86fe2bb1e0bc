"""Logs of labs whose motion capture speaks other messages, on other clocks and along other axes than ours."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.errors import UsageError
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.foreign_clocks import clock_finding, clocks_of
from hil.replay.foreign_log import foreign_inputs
from hil.replay.rerun import replay_foreign
from hil.replay.topic_map import TopicMap, load_topic_map
from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire.messages import encode, header, typename_of
from hil.wire.pose_sources import laid, message_of
from hil.wire.records import Placement

START_NS = 1_700_000_000_000_000_000
PERIOD_NS, FRAMES = 20_000_000, 150
V1, V2, U = 0.08, 0.1, 0.1
BODIES = ("tb-1", "tb-2")

Sent = tuple[str, msg.Message, int]
"""Topic, message and log time [ns]."""


def poses(t: float) -> tuple[Pose, Pose]:
    """Leader and follower on circles around one point, side by side."""
    return (
        Pose(V1 / U * math.sin(U * t), V1 / U * (1.0 - math.cos(U * t)), U * t),
        Pose(V2 / U * math.sin(U * t), V1 / U - V2 / U * math.cos(U * t), U * t),
    )


def place_of(pose: Pose) -> Placement:
    return Placement(pose.x, pose.y, 0.12, 0.0, 0.0, math.sin(0.5 * pose.theta), math.cos(0.5 * pose.theta))


def mocap(
    kind: SourceType, *, apart: bool, stamp_ns: int | None = None, behind_ns: int = 0, **how: Any
) -> Iterator[Sent]:
    """Messages of both bodies in one, or (``apart``) of each on a topic of its own."""
    up, scale, frame_ids = how.get("up", "z"), how.get("scale", 1.0), how.get("frame_ids", ("world", "world"))
    for k in range(FRAMES):
        at_ns = START_NS + k * PERIOD_NS
        seen = [laid(place_of(pose), up, scale) for pose in poses(k * PERIOD_NS * 1e-9)]
        told_ns = at_ns - behind_ns if stamp_ns is None else stamp_ns
        named = list(zip(BODIES, seen, strict=True))
        late_ns = at_ns + 4_000_000
        if not apart:
            yield "/all", message_of(kind, header(told_ns, frame_ids[0]), named), late_ns
            continue
        for (name, place), frame_id in zip(named, frame_ids, strict=True):
            yield f"/{name}/pose", message_of(kind, header(told_ns, frame_id), [(name, place)]), late_ns


def odometry() -> Iterator[Sent]:
    for k in range(FRAMES):
        at_ns = START_NS + k * PERIOD_NS
        yield "/tb2/odom", odometry_message(at_ns, "tb2", Pose(0.0, 0.0, 0.0), Motion(V2, U)), at_ns + 1000


def written(folder: Path, *sources: Iterator[Sent]) -> Log:
    sent = sorted((each for source in sources for each in source), key=lambda each: each[2])
    with LogWriter(folder / "lab.mcap", {}) as log:
        for topic, message, log_ns in sent:
            log.write(topic, typename_of(message), encode(message), log_ns, log_ns)
    return read_log(folder / "lab.mcap")


def mapped(folder: Path, *, apart: bool, more: str = "", odometry: str = '"/tb2/odom"') -> TopicMap:
    where = 'leader_pose = "tb-1/pose"\nfollower_pose = "/tb-2/pose"' if apart else 'rigid_bodies = "/all"'
    text = f'[topics]\nodometry = {odometry}\n{where}\n{more}\n[bodies]\nleader = "tb-1"\nfollower = "tb-2"\n'
    (folder / "map.toml").write_text(text)
    return load_topic_map(str(folder / "map.toml"))


def is_right(log: Log, chart: TopicMap, found: dict[str, str] | None = None) -> None:
    played = replay_foreign(log, chart)
    last = played.estimates[-1]
    assert not played.estimator.refused
    assert last.status == 1
    assert last.v1 == pytest.approx(V1, abs=1e-3)
    assert last.rho == pytest.approx(V2 / U - V1 / U, abs=2e-3)
    assert dict(played.found["log"]) == (found or {})


ALL: list[SourceType] = ["RigidBodies", "NamedPoseArray", "TFMessage"]
EACH: list[SourceType] = ["PoseStamped", "PoseWithCovarianceStamped", "Odometry", "TransformStamped"]


@pytest.mark.parametrize(
    ("kind", "apart"), [(k, False) for k in ALL] + [(k, True) for k in [*EACH, "TFMessage", "NamedPoseArray"]]
)
@pytest.mark.parametrize("stamp_ns", [None, 0])
def test_whatever_messages_tell_the_poses_the_leader_is_found(
    kind: SourceType, apart: bool, stamp_ns: int | None, tmp_path: Path
) -> None:
    log = written(tmp_path, mocap(kind, apart=apart, stamp_ns=stamp_ns), odometry())
    is_right(log, mapped(tmp_path, apart=apart))


@pytest.mark.parametrize("kind", ["TFMessage", "TransformStamped"])
def test_transforms_of_one_body_each_on_one_topic_are_paired(kind: SourceType, tmp_path: Path) -> None:
    single = (("/all", message, at_ns) for _, message, at_ns in mocap(kind, apart=True))
    is_right(written(tmp_path, single, odometry()), mapped(tmp_path, apart=False))


def test_stamps_can_be_left_aside_of_one_topic(tmp_path: Path) -> None:
    log = written(tmp_path, mocap("RigidBodies", apart=False, stamp_ns=5_000_000_000), odometry())
    text = mapped(tmp_path, apart=False).path.read_text()
    (tmp_path / "map.toml").write_text(text.replace('"/all"', '{ topic = "/all", stamp = "receive" }'))
    is_right(log, load_topic_map(str(tmp_path / "map.toml")))


@pytest.mark.parametrize("scale", [1.0, 0.001])
@pytest.mark.parametrize("apart", [False, True])
def test_axes_and_unit_are_set_by_the_map(scale: float, apart: bool, tmp_path: Path) -> None:
    kind: SourceType = "PoseStamped" if apart else "RigidBodies"
    log = written(tmp_path, mocap(kind, apart=apart, up="y", scale=scale), odometry())
    is_right(log, mapped(tmp_path, apart=apart, more=f'up = "y"\nscale = {scale}'))
    scenario = f'[scenario.source]\nup = "y"\nscale = {scale}'
    chart = mapped(tmp_path, apart=apart)
    chart.path.write_text(chart.path.read_text() + scenario)
    is_right(log, load_topic_map(str(chart.path)))


def test_axes_that_lie_otherwise_are_found(tmp_path: Path) -> None:
    log = written(tmp_path, mocap("RigidBodies", apart=False, up="y", scale=0.001), odometry())
    found = foreign_inputs(log, mapped(tmp_path, apart=False)).found
    assert set(found) == {"axes", "unit"}
    assert 'up = "y"' in found["axes"]
    assert "scale = 0.001" in found["unit"]


def test_poses_in_two_frames_of_reference_are_refused_with_both_named(tmp_path: Path) -> None:
    log = written(tmp_path, mocap("PoseStamped", apart=True, frame_ids=("tb1/odom", "tb2/odom")), odometry())
    with pytest.raises(UsageError, match=r"leader's poses are in frame 'tb1/odom'.*'tb2/odom'"):
        foreign_inputs(log, mapped(tmp_path, apart=True))


@pytest.mark.parametrize("hours", [-3.0, 0.1])
def test_the_clock_of_a_source_is_put_right_and_said(hours: float, tmp_path: Path) -> None:
    behind_ns = round(hours * 3.6e12)
    log = written(tmp_path, mocap("RigidBodies", apart=False, behind_ns=behind_ns), odometry())
    where = "behind" if behind_ns > 0 else "ahead of"
    said = (
        f"stamps on '/all' are {abs(behind_ns * 1e-9 + 0.004):.3f} s {where} the other clocks; "
        "shifted so that the freshest has no age"
    )
    is_right(log, mapped(tmp_path, apart=False), {"clock": said})


def test_one_wild_stamp_costs_one_message(tmp_path: Path) -> None:
    def wild() -> Iterator[Sent]:
        for number, (topic, message, at_ns) in enumerate(odometry()):
            assert isinstance(message, msg.Odometry)
            if number == 40:
                message = replace(message, header=header(at_ns + 3_600_000_000_000, "odom"))
            yield topic, message, at_ns

    log = written(tmp_path, mocap("RigidBodies", apart=False), wild())
    inputs = foreign_inputs(log, mapped(tmp_path, apart=False))
    assert len(inputs.events) == 2 * FRAMES - 1
    assert f"1 of {FRAMES} stamps on '/tb2/odom'" in inputs.found["clock"]


@pytest.mark.parametrize("entry", ['"/cmd"', '{ topic = "/cmd", type = "geometry_msgs/msg/Twist" }'])
def test_commands_without_stamps_tell_the_followers_own_motion(entry: str, tmp_path: Path) -> None:
    def commands() -> Iterator[Sent]:
        for _, message, at_ns in odometry():
            assert isinstance(message, msg.Odometry)
            yield "/cmd", message.twist.twist, at_ns

    log = written(tmp_path, mocap("RigidBodies", apart=False), commands())
    chart = mapped(tmp_path, apart=False, odometry=entry)
    is_right(log, chart)
    last = replay_foreign(log, chart).estimates[-1]
    assert (last.v2, last.u2) == (V2, U)


def test_a_leader_without_an_orientation_is_followed(tmp_path: Path) -> None:
    def single() -> Iterator[Sent]:
        for topic, message, at_ns in mocap("RigidBodies", apart=False):
            assert isinstance(message, msg.RigidBodies)
            leader, follower = message.rigidbodies
            none = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
            bare = replace(leader, pose=replace(leader.pose, orientation=none))
            yield topic, replace(message, rigidbodies=[bare, follower]), at_ns

    is_right(written(tmp_path, single(), odometry()), mapped(tmp_path, apart=False))


SECOND = 1_000_000_000
jitter = st.lists(st.integers(0, 300_000_000), min_size=5, max_size=30)


@given(frames=jitter, motion=jitter, common=st.integers(-(10**15), 10**15))
def test_one_clock_for_all_keeps_what_lies_between_the_topics(
    frames: list[int], motion: list[int], common: int
) -> None:
    clocks = clocks_of({"f": [a + common for a in frames], "m": [a + common for a in motion]})
    assert not clocks.shifts
    least = min(*frames, *motion) + common
    assert clocks.log_shift == (0 if 0 <= least <= SECOND else least)
    assert not clock_finding(clocks, {}, {})


@given(
    frames=jitter,
    motion=jitter,
    off=st.integers(2 * SECOND, 10**15),
    ahead=st.booleans(),
    wild=st.integers(2 * SECOND, 10**15),
)
def test_a_clock_of_its_own_is_found_whatever_single_stamps_say(
    frames: list[int], motion: list[int], off: int, ahead: bool, wild: int
) -> None:
    by = -off if ahead else off
    shifted = [age + by for age in frames]
    clocks = clocks_of({"f": shifted, "m": [*motion, -wild]})
    assert clocks.log_shift == 0
    assert clocks.shifts == {"f": min(shifted)}
    assert clocks.is_wild("m", -wild)
    assert not any(clocks.is_wild("m", age) for age in motion)
    assert not any(clocks.is_wild("f", age) for age in shifted)
