"""The doctor's command on a wire that a test holds the other end of."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import pytest

from formation.pose import Motion
from hil.wire.drive_message import drive_message
from hil.wire.message_types import TwistStamped
from hil.wire.messages import decode_as, encode
from tests.routers import router

PATIENCE = 60.0


def visiting(endpoint: str) -> subprocess.Popen[str]:
    asked = ["doctor", "--drive", "follower", "--duration", "0.5", "--json", "--connect", endpoint]
    return subprocess.Popen(
        [sys.executable, "-m", "hil", *asked], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_doctor_that_is_ended_leaves_the_robot_standing(by: signal.Signals) -> None:
    with router() as (endpoint, wire):
        wire.subscribe(["follower/cmd_vel"])
        doctor, told = visiting(endpoint), list[float]()
        while (event := wire.inbox.take(PATIENCE if doctor.poll() is None else 0.5)) is not None:
            told.append(decode_as(event.payload, TwistStamped).twist.linear.x)
            if told[-1] == 0.05 and told.count(0.05) == 5:
                doctor.send_signal(by)
                _, said = doctor.communicate(timeout=PATIENCE)
    assert 0.05 in told
    assert told[-1] == 0.0
    assert told.count(0.05) < 60
    assert doctor.returncode == 1
    assert "follower stands: the doctor was ended" in said


def test_who_begins_to_command_while_it_counts_down_keeps_the_robot() -> None:
    with router() as (endpoint, wire):
        doctor = visiting(endpoint)
        assert doctor.stderr is not None
        while "in 2" not in doctor.stderr.readline():
            assert doctor.poll() is None
        told = drive_message(Motion(0.0, 0.0), 1, "follower", stamped=True)
        wire.publish("follower/cmd_vel", encode(told))
        wire.subscribe(["follower/cmd_vel"])
        out, _ = doctor.communicate(timeout=PATIENCE)
        assert wire.inbox.take(0.0) is None
    assert doctor.returncode == 1
    (drive,) = (each for each in json.loads(out)["checks"] if each["name"] == "drive")
    assert drive["seen"] == "follower: 1 commands of somebody else on follower/cmd_vel; it was not driven"
