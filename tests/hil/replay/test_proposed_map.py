"""The map that is proposed for a lab's log names what is there, and replays it."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.errors import UsageError
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.proposed_map import proposed_map
from hil.replay.rerun import replay_foreign
from hil.replay.topic_map import load_topic_map
from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire.messages import encode, header, typename_of
from hil.wire.pose_sources import laid, message_of
from hil.wire.records import Placement

START_NS = 1_700_000_000_000_000_000
PERIOD_NS, FRAMES = 20_000_000, 200
V1, V2, U = 0.08, 0.1, 0.1

Sent = tuple[str, msg.Message, int]


def place(v: float, t: float, up: str, scale: float) -> Placement:
    theta = U * t
    x, y = v / U * math.sin(theta), V1 / U - v / U * math.cos(theta)
    return laid(Placement(x, y, 0.1, 0.0, 0.0, math.sin(0.5 * theta), math.cos(0.5 * theta)), up, scale)


def poses(
    kind: SourceType,
    topic: Callable[[str], str],
    names: tuple[str, ...],
    *,
    up: str = "z",
    scale: float = 1.0,
    apart_ns: int = 0,
    stamped: bool = True,
) -> list[Sent]:
    """Messages of a lab: one for all bodies where the topics are the same, else one for each.

    The first body leads, the second follows; whoever comes next stands.
    """
    sent: list[Sent] = []
    for k in range(FRAMES):
        t, at_ns = k * PERIOD_NS * 1e-9, START_NS + k * PERIOD_NS
        places = [place(V1, t, up, scale), place(V2, t + apart_ns * 1e-9, up, scale)]
        places += [place(0.5, 0.0, up, scale)] * (len(names) - 2)
        seen = list(zip(names, places, strict=True))
        if topic(names[0]) == topic(names[1]):
            head = header(at_ns if stamped else 0, "map")
            sent.append((topic(""), message_of(kind, head, seen), at_ns))
            continue
        for number, one in enumerate(seen):
            later = at_ns + (apart_ns if number == 1 else 0)
            sent.append((topic(one[0]), message_of(kind, header(later, "map"), [one]), later))
    return sent


def odometry(topic: str, v: float) -> list[Sent]:
    return [
        (topic, odometry_message(at_ns, "x", Pose(0.0, 0.0, 0.0), Motion(v, U)), at_ns + 1000)
        for at_ns in range(START_NS, START_NS + FRAMES * PERIOD_NS, PERIOD_NS)
    ]


def twists(topic: str, v: float) -> list[Sent]:
    kept: list[Sent] = []
    for _, message, at_ns in odometry(topic, v):
        assert isinstance(message, msg.Odometry)
        kept.append((topic, message.twist.twist, at_ns))
    return kept


def written(folder: Path, *sources: list[Sent]) -> Log:
    sent = sorted((each for source in sources for each in source), key=lambda each: each[2])
    with LogWriter(folder / "lab.mcap", {}) as log:
        for topic, message, log_ns in sent:
            log.write(topic, typename_of(message), encode(message), log_ns, log_ns)
    return read_log(folder / "lab.mcap")


def replays(folder: Path, log: Log, text: str) -> dict[str, Any]:
    """Replay a log by a map that was saved; gives what the map holds."""
    (folder / "map.toml").write_text(text)
    chart = load_topic_map(str(folder / "map.toml"))
    played = replay_foreign(log, chart)
    last = played.estimates[-1]
    assert last.status == 1
    assert last.v1 == pytest.approx(V1, abs=3e-3)
    assert last.rho == pytest.approx((V2 - V1) / U, abs=3e-3)
    return tomllib.loads(text)


ALL: list[SourceType] = ["RigidBodies", "NamedPoseArray", "TFMessage"]
EACH: list[SourceType] = ["PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Odometry"]
NAMES = ("tb3_0", "tb3_1")


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize(("up", "scale"), [("z", 1.0), ("y", 1.0)])
def test_a_topic_of_all_bodies_is_found(kind: SourceType, up: str, scale: float, tmp_path: Path) -> None:
    names = (*NAMES, "wand")
    log = written(
        tmp_path, poses(kind, lambda _: "/mocap", names, up=up, scale=scale), odometry("/tb3_1/odom", V2)
    )
    found = replays(tmp_path, log, proposed_map(log))
    assert found["bodies"] == {"leader": "tb3_0", "follower": "tb3_1"}
    assert found["topics"].pop("up", "z") == up
    assert found["topics"] == {"rigid_bodies": "/mocap", "odometry": "/tb3_1/odom"}


@pytest.mark.parametrize("kind", EACH)
@pytest.mark.parametrize("apart_ns", [0, 5_000_000])
def test_a_topic_for_each_body_is_found(kind: SourceType, apart_ns: int, tmp_path: Path) -> None:
    seen = poses(kind, lambda name: f"/vrpn/{name}/pose", NAMES, apart_ns=apart_ns)
    log = written(tmp_path, seen, twists("/tb3_1/cmd_vel", V2), odometry("/tb3_1/odom", V2))
    found = replays(tmp_path, log, proposed_map(log))
    topics = found["topics"]
    assert (topics["leader_pose"], topics["follower_pose"]) == ("/vrpn/tb3_0/pose", "/vrpn/tb3_1/pose")
    assert topics["odometry"] == "/tb3_1/odom"
    assert topics.get("pair_within_s", 0.002) >= apart_ns * 1e-9


def test_commands_stand_in_for_odometry(tmp_path: Path) -> None:
    log = written(tmp_path, poses("RigidBodies", lambda _: "/mocap", NAMES), twists("/tb3_1/cmd_vel", V2))
    found = replays(tmp_path, log, proposed_map(log))
    assert found["topics"]["odometry"] == "/tb3_1/cmd_vel"
    assert found["scenario"]["estimator"]["input_lag_s"] == 0.3


def test_what_cannot_be_told_is_said(tmp_path: Path) -> None:
    log = written(tmp_path, poses("NamedPoseArray", lambda _: "/poses", ("1", "2"), stamped=False))
    text = proposed_map(log)
    found = replays(tmp_path, log, text)
    assert found["bodies"] == {"leader": "1", "follower": "2"}
    for said in ("Who follows whom could not be told", "all stamps of the poses are 0", "none of the foll"):
        assert said in text
    assert tomllib.loads(proposed_map(log, follower="1"))["bodies"] == {"leader": "2", "follower": "1"}
    with pytest.raises(UsageError, match="body '3' is not in the log; expected one of: 1, 2"):
        proposed_map(log, leader="3")


def test_millimetres_are_told_by_how_far_bodies_are_apart(tmp_path: Path) -> None:
    log = written(
        tmp_path,
        poses("RigidBodies", lambda _: "/mocap", NAMES, scale=0.001),
        odometry("/tb3_1/odom", V2),
    )
    assert replays(tmp_path, log, proposed_map(log))["topics"]["scale"] == 0.001


def test_a_log_without_poses_is_answered_with_what_is_there(tmp_path: Path) -> None:
    log = written(tmp_path, odometry("/tb3_1/odom", V2))
    with pytest.raises(UsageError, match=r"topics there: /tb3_1/odom \(nav_msgs/msg/Odometry\)"):
        proposed_map(log)
