"""`abreast emulator --natnet` read by clients that others wrote."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from hil.wire import topics
from hil.wire.message_types import RigidBodies
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from tests.real.ros_lab import HERE, peer
from tests.routers import router

pytestmark = pytest.mark.slow

PATIENCE = 300.0
RATE = 120
SECONDS = 10
LEADER, FOLLOWER = "leader's plate", "2"


@contextmanager
def emulator(version: str) -> Iterator[int]:
    """The command port of an emulator with bodies of these names that nobody else is needed for."""
    asked = ["--natnet-version", version, "--natnet-command-port", "0", "--natnet-data-port", "0"]
    names = ["--set", f'leader.body="{LEADER}"', "--set", f'follower.body="{FOLLOWER}"']
    process = subprocess.Popen(
        [sys.executable, "-m", "hil", "emulator", "turtlebot3", "--natnet", *asked, *names],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        found = re.search(rf"ready, serves NatNet {version} .*command port (\d+)", process.stderr.readline())
        assert found is not None
        yield int(found[1])
    finally:
        process.terminate()
        _, rest = process.communicate(timeout=PATIENCE)
    assert (process.returncode, rest) == (0, "")


def read_by(python: Path, script: str, *arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        [python, HERE / script, *arguments], capture_output=True, text=True, timeout=PATIENCE, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def moved(before: list[float], after: list[float]) -> float:
    return math.dist(before, after)


@pytest.mark.parametrize("version", ["3.0", "3.1", "4.0", "4.1"])
def test_natnet_reads_it_without_missing_a_frame(version: str, peers: Path) -> None:
    with emulator(version) as port:
        found = read_by(peers, "natnet_client.py", str(port), str(SECONDS))
    numbers, positions = found["numbers"], found["positions"]
    assert found["version"] == f"{version}.0.0"
    assert found["names"] == {"1": LEADER, "2": FOLLOWER}
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len(numbers) > 0.9 * SECONDS * RATE
    assert found["tracked"]
    assert set(found["markers"]) == {6}
    # The leader goes its way at 0.08 m/s and the follower stands, both by the clock that is served.
    lasted = (found["stamps"][-1] - found["stamps"][0]) * 1e-7
    assert lasted == pytest.approx((len(numbers) - 1) / RATE, abs=0.01)
    steps = [moved(before["1"], after["1"]) for before, after in pairwise(positions[::12])]
    assert 0.05 < sum(steps) / lasted < 0.1
    assert moved(positions[0]["2"], positions[-1]["2"]) < 0.001


@pytest.mark.parametrize("version", ["3.0", "3.1", "4.0", "4.1"])
def test_motioncapture_reads_names_and_frames_of_it(version: str, peers: Path) -> None:
    """Of frames that wait it takes the last, so none can be called missed; but each must be another one."""
    with emulator(version) as port:
        frames = read_by(peers, "motioncapture_client.py", str(port), str(SECONDS * RATE))["frames"]
    assert {tuple(sorted(frame)) for frame in frames} == {(FOLLOWER, LEADER)}
    assert all(before[LEADER] != after[LEADER] for before, after in pairwise(frames))


@pytest.mark.parametrize("version", ["3.1", "4.1"])
def test_who_takes_the_first_answer_for_the_model_gets_it_every_time(version: str, peers: Path) -> None:
    """A frame in its place is why motioncapture knows no names of some servers, one time in five."""
    with emulator(version) as port:
        for _ in range(12):
            (frame,) = read_by(peers, "motioncapture_client.py", str(port), "1")["frames"]
            assert set(frame) == {FOLLOWER, LEADER}


def test_our_bridge_through_motioncapture_publishes_what_it_reads(peers: Path) -> None:
    with emulator("4.1") as port, router() as (endpoint, wire):
        wire.subscribe([topics.RIGID_BODIES, topics.DIAGNOSTICS])
        names = ["--set", f'leader.body="{LEADER}"', "--set", f'follower.body="{FOLLOWER}"']
        asked = ["--type", "optitrack", "--server", f"127.0.0.1:{port}", "--connect", endpoint]
        with peer("bridge", ["-m", "hil", "bridge", "mocap", *asked, *names], peers) as bridge:
            bridge.wait_for("sees ")
            frames = [decode_as(payload, RigidBodies) for payload in heard(wire, topics.RIGID_BODIES, 240)]
    assert {tuple(sorted(body.rigid_body_name for body in frame.rigidbodies)) for frame in frames} == {
        (FOLLOWER, LEADER)
    }
    numbers = [frame.frame_number for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def heard(wire: Wire, topic: str, count: int) -> list[bytes]:
    """So many payloads on a topic."""
    found: list[bytes] = []
    until = time.monotonic() + PATIENCE
    while len(found) < count and time.monotonic() < until:
        event = wire.inbox.take(0.1)
        if event is not None and event.topic == topic:
            found.append(event.payload)
    return found
