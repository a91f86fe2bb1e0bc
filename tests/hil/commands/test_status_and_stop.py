from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator

import pytest

from formation.pose import Motion
from hil.nodes.node import diagnostics
from hil.wire.drive_message import drive_message
from hil.wire.message_types import String, TwistStamped
from hil.wire.messages import decode_as, encode
from hil.wire.pubsub import Wire
from hil.wire.session import reserved_endpoint
from tests.routers import router
from tests.said_again import again, odometry


@pytest.fixture
def lab() -> Iterator[tuple[str, Wire]]:
    with router() as found:
        yield found


def drive(v: float, *, stamped: bool = True) -> bytes:
    return encode(drive_message(Motion(v, 0.0), 5, "", stamped=stamped))


ROBOTS = odometry("leader"), odometry("follower")


def ran(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hil", *arguments], capture_output=True, text=True, check=False
    )


def test_a_stop_reaches_everybody_with_its_reason(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    wire.subscribe(["stop", "leader/cmd_vel", "follower/cmd_vel"])
    with again(wire, *ROBOTS):
        done = ran("stop", "enough of it", "--connect", endpoint)
    assert done.returncode == 0, done.stderr
    assert "leader, follower told to stand (enough of it): leader stands (odometry 0.000 m/s" in done.stdout
    heard: dict[str, bytes] = {}
    while (event := wire.inbox.take(0.2)) is not None:
        heard[event.topic] = event.payload
    assert set(heard) == {"stop", "leader/cmd_vel", "follower/cmd_vel"}
    assert decode_as(heard["stop"], String).data == "enough of it"


def test_a_stop_says_who_moves_on_by_its_odometry(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    with again(wire, odometry("leader"), odometry("follower", Motion(0.12, 0.0))):
        done = ran("stop", "--connect", endpoint)
    assert (done.returncode, done.stdout) == (1, "")
    assert "leader stands (" in done.stderr
    assert "follower was told to stand and still moves at 0.12 m/s; use the robot's switch" in done.stderr


def test_a_stop_by_other_names_says_whose_guards_stopped(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    held = diagnostics("guard/robot7", 5, "latched (stopped): by hand", {"latched": "stopped"})
    with again(wire, odometry("robot7"), ("diagnostics", encode(held))):
        done = ran("stop", "--connect", endpoint)
    assert done.returncode == 1
    assert "nothing was heard of leader, follower on this wire; guard/robot7 did stop; " in done.stderr


@pytest.mark.parametrize(
    "command", [drive(0.1), drive(0.0, stamped=False)], ids=["drives on", "in another type"]
)
def test_a_stop_says_who_is_driven_in_spite_of_it(lab: tuple[str, Wire], command: bytes) -> None:
    endpoint, wire = lab
    with again(wire, *ROBOTS, ("follower/cmd_vel", command)):
        done = ran("stop", "--connect", endpoint)
    assert done.returncode == 1
    assert "somebody still drives follower" in done.stderr


def test_a_stop_that_hears_only_itself_has_stopped_nobody(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    wire.subscribe(["stop", "follower/cmd_vel"])
    done = ran("stop", "--connect", endpoint)
    assert done.returncode == 1
    assert "nothing was heard of leader, follower on this wire; use the robot's switch" in done.stderr
    assert "give --scenario FILE" in done.stderr
    assert done.stderr.count("\n") == 1
    heard = {event.topic for event in iter(lambda: wire.inbox.take(0.2), None)}
    assert heard == {"stop", "follower/cmd_vel"}


def test_a_stop_names_the_robot_that_it_does_not_hear_of(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    with again(wire, odometry("leader")):
        done = ran("stop", "--connect", endpoint)
    assert done.returncode == 1
    assert "nothing was heard of follower on this wire" in done.stderr
    with again(wire, odometry("leader"), ("follower/cmd_vel", drive(0.0))):
        done = ran("stop", "--connect", endpoint)
    assert done.returncode == 0, done.stderr


def test_status_tells_what_passes_as_json(lab: tuple[str, Wire]) -> None:
    endpoint, _ = lab
    done = ran("status", "--json", "--connect", endpoint)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["daemons"], told["missing_bodies"]) == ([], ["leader", "follower"])
    shown = ran("status", "--once", "--connect", endpoint)
    assert "not seen" in shown.stdout


def test_status_shows_what_looks_like_markup_as_it_is(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    report = diagnostics("estimator[0]", 5, "[/lab] waits for [source]", {"refused.[b]": 7, "refused.c": "²"})
    with again(wire, ("diagnostics", encode(report))):
        shown = ran("status", "--once", "--connect", endpoint)
    assert shown.returncode == 0, shown.stderr
    text = " ".join(shown.stdout.split())
    for part in ("estimator[0]", "[/lab] waits for [source]", "refused: 7 [b]"):
        assert part in text


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
        if told[-1] == 0.05 and told.count(0.05) == 5:
            wire.publish("stop", encode(String(data="enough")))
        if told.count(0.05) >= 5 and told[-1] == 0.0:
            break
    _, said = doctor.communicate(timeout=60.0)
    assert max(told) == 0.05
    assert len(told) < 60
    assert doctor.returncode == 1
    assert "follower stands: somebody said stop (enough)" in said


def test_one_look_ends_with_1_unless_all_that_is_needed_is_heard_and_well(lab: tuple[str, Wire]) -> None:
    endpoint, wire = lab
    look = ("status", "--once", "--connect", endpoint, "--needs")
    deaf = {"finding.deaf_robot": "nobody listens"}
    said = (
        ("diagnostics", encode(diagnostics("recorder", 5, "", {}))),
        ("diagnostics", encode(diagnostics("estimator", 5, "waiting for frames", {}))),
        ("diagnostics", encode(diagnostics("controller", 5, "", deaf))),
    )
    with again(wire, *said):
        assert ran(*look, "recorder").returncode == 0
        done = ran(*look, "recorder, estimator,controller,leader")
    assert done.returncode == 1
    for words in ("estimator: waiting for frames", "controller: deaf_robot: nobody", "leader is not heard"):
        assert words in done.stderr
    assert "recorder:" not in done.stderr


@pytest.mark.parametrize("needs", ["", ",", "recorder,"])
def test_no_names_are_no_needs(needs: str) -> None:
    done = ran("status", "--once", "--needs", needs)
    assert (done.returncode, done.stdout) == (2, "")
    assert "expected names of nodes" in done.stderr


def test_what_is_needed_is_for_one_look(lab: tuple[str, Wire]) -> None:
    done = ran("status", "--connect", lab[0], "--needs", "recorder")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--once" in done.stderr
