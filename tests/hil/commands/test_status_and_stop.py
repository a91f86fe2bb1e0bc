from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from formation.pose import Motion
from hil.wire.drive_message import drive_message
from hil.wire.message_types import String, TwistStamped
from hil.wire.messages import decode_as, encode
from hil.wire.pubsub import Wire
from hil.wire.session import reserved_endpoint
from tests.routers import router


@pytest.fixture
def lab() -> Iterator[tuple[str, Wire]]:
    with router() as found:
        yield found


def ran(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hil", *arguments], capture_output=True, text=True, check=False
    )


def test_a_stop_reaches_everybody_with_its_reason(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    wire.subscribe(["stop", "leader/cmd_vel", "follower/cmd_vel"])
    done = ran("stop", "enough of it", "--connect", endpoint)
    assert done.returncode == 0, done.stderr
    assert "leader, follower told to stand (enough of it)" in done.stderr
    heard: dict[str, bytes] = {}
    while (event := wire.inbox.take(0.2)) is not None:
        heard[event.topic] = event.payload
    assert set(heard) == {"stop", "leader/cmd_vel", "follower/cmd_vel"}
    assert decode_as(heard["stop"], String).data == "enough of it"


def test_a_stop_says_who_is_driven_in_spite_of_it(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    over = threading.Event()

    def drive_on() -> None:
        while not over.wait(0.02):
            wire.publish("follower/cmd_vel", encode(drive_message(Motion(0.1, 0.0), 5, "", stamped=True)))

    stubborn = threading.Thread(target=drive_on)
    stubborn.start()
    try:
        done = ran("stop", "--connect", endpoint)
    finally:
        over.set()
        stubborn.join()
    assert done.returncode == 1
    assert "somebody still drives follower" in done.stderr


def test_status_tells_what_passes_as_json(lab: tuple[str, Wire]) -> None:
    endpoint, _ = lab
    done = ran("status", "--json", "--connect", endpoint)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["daemons"], told["missing_bodies"]) == ([], ["leader", "follower"])
    shown = ran("status", "--once", "--connect", endpoint)
    assert "not seen" in shown.stdout


@pytest.mark.parametrize("command", ["status", "stop"])
def test_without_a_router_there_is_nobody_to_ask(command: str) -> None:
    with reserved_endpoint() as endpoint:
        done = ran(command, "--connect", endpoint)
    assert done.returncode == 1
    assert "is the router up" in done.stderr


def test_a_doctor_who_lets_a_robot_creep_heeds_a_stop(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    wire.subscribe(["follower/cmd_vel"])
    asked = ["doctor", "--drive", "follower", "--duration", "0.5", "--connect", endpoint]
    doctor = subprocess.Popen(
        [sys.executable, "-m", "hil", *asked], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    told = []
    while (event := wire.inbox.take(60.0)) is not None:
        told.append(decode_as(event.payload, TwistStamped).twist.linear.x)
        if len(told) == 5:
            wire.publish("stop", encode(String(data="enough")))
        if len(told) > 5 and told[-1] == 0.0:
            break
    _, said = doctor.communicate(timeout=60.0)
    assert max(told) == 0.05
    assert len(told) < 60
    assert doctor.returncode == 1
    assert "follower stands: somebody said stop (enough)" in said
