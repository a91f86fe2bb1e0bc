"""The bridge through the library: bodies as it lists them, and what is said where it fails or is missing."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass, field

import pytest

from hil.bridge.mocap_wire import MocapWire
from hil.bridge.motioncapture_bridge import MotionCaptureBridge, Source, connector
from hil.errors import AbreastError, UsageError
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import RigidBodies
from hil.wire.messages import decode_as, to_ns

PATIENCE = 60.0


@dataclass
class Rotation:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.6
    w: float = 0.8


@dataclass
class Seen:
    position: tuple[float, float, float]
    rotation: Rotation = field(default_factory=Rotation)


@dataclass
class Given:
    """A source that gives some frames, and then waits for ever or fails."""

    frames: list[dict[str, Seen]]
    fails: str = ""
    rigidBodies: dict[str, Seen] = field(default_factory=dict)  # noqa: N815

    def waitForNextFrame(self) -> None:  # noqa: N802
        if self.frames:
            self.rigidBodies = self.frames.pop(0)
        elif self.fails:
            raise RuntimeError(self.fails)
        else:
            threading.Event().wait()


def bridge(source: Source, said: list[str]) -> MotionCaptureBridge:
    wire = MocapWire("bridge/mocap", load_scenario("turtlebot3"), None, said.append)
    return MotionCaptureBridge(lambda: source, "vicon 192.0.2.1", wire)


def take_frames(bridge: MotionCaptureBridge, out: list[Outgoing], count: int) -> None:
    """So many frames of it, into a list."""
    until = time.monotonic() + PATIENCE
    while len(out) < count and time.monotonic() < until:
        bridge.wait(0.05)
        out.extend(each for each in bridge.take(time.time_ns()) if each.topic == topics.RIGID_BODIES)


def test_every_frame_is_published_with_the_bodies_that_are_listed() -> None:
    both = {"leader": Seen((1.0, 2.0, 0.1)), "follower": Seen((3.0, 4.0, 0.1))}
    before_ns = time.time_ns()
    out: list[Outgoing] = []
    take_frames(bridge(Given([both, {"leader": both["leader"]}, {}]), []), out, 3)
    frames = [decode_as(each.payload, RigidBodies) for each in out]
    assert [frame.frame_number for frame in frames] == [1, 2, 3]
    assert [[body.rigid_body_name for body in frame.rigidbodies] for frame in frames] == [
        ["leader", "follower"],
        ["leader"],
        [],
    ]
    pose = frames[0].rigidbodies[1].pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (3.0, 4.0, 0.1)
    assert (pose.orientation.z, pose.orientation.w) == (0.6, 0.8)
    assert all(before_ns <= to_ns(frame.header.stamp) <= time.time_ns() for frame in frames)


def test_what_the_library_fails_of_is_told_after_the_frames_before() -> None:
    failing = bridge(Given([{"leader": Seen((0.0, 0.0, 0.0))}], fails="No\nroute."), [])
    out: list[Outgoing] = []
    with pytest.raises(AbreastError, match=r"^vicon 192\.0\.2\.1: No route\.; is its address right"):
        take_frames(failing, out, 2)
    assert len(out) == 1


def test_it_says_that_it_waits_for_an_answer() -> None:
    said: list[str] = []
    wire = MocapWire("bridge/mocap", load_scenario("turtlebot3"), None, said.append)

    def never() -> Source:
        threading.Event().wait()
        raise AssertionError

    waiting = MotionCaptureBridge(never, "qualisys lab", wire)
    waiting.wait(0.0)
    list(waiting.take(time.time_ns()))
    assert said == ["waiting for an answer of qualisys lab"]


def test_without_the_library_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(UsageError, match=r"pip install 'abreast\[mocap\]'"):
        connector("vicon", "192.0.2.1")
