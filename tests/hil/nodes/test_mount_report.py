"""A follower whose body sits otherwise than is said: it is named, and stopped where its heading is wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from estimation.models.measurement import PoseNoise
from estimation.tracking.mount_check import NO_MOUNT_CHECK, MountCheck, mount_checked
from formation.mount import Mount, body_pose
from formation.pose import Pose, advance
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.nodes.leader_mount import UNWATCHED, with_leader
from hil.nodes.mount_report import mount_findings, mount_problem, mount_report
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import Command, DiagnosticArray, LeaderEstimate
from hil.wire.messages import decode_as

REASON = "follower's heading is not its direction of travel: calibrate its mount"


def watching(mount: Mount) -> MountCheck:
    """Check of a follower with this body after five seconds of winding, without noise."""
    check, pose = NO_MOUNT_CHECK, Pose(0.0, 0.0, 1.0)
    for k in range(600):
        pose = advance(pose, 0.1, 0.6 * math.sin(0.02 * k), 1.0 / 120.0)
        at_ns = round(1e9 * k / 120)
        check = mount_checked(check, at_ns, body_pose(pose, mount), PoseNoise(3e-4, 3.5e-3), False)
    return check


def test_nothing_is_said_of_a_body_that_sits_as_it_should_or_of_one_hardly_seen() -> None:
    for check in (NO_MOUNT_CHECK, watching(Mount(0.0, 0.0, 0.0))):
        assert mount_findings(check) == {}
        assert mount_problem(check, stops=True) == ""
    assert mount_report(NO_MOUNT_CHECK) == {}


def test_a_yaw_and_a_place_are_named_with_what_was_seen() -> None:
    turned, ahead = watching(Mount(0.0, 0.0, math.radians(10.0))), watching(Mount(0.03, 0.0, 0.0))
    assert set(mount_findings(turned)) == {"frame_yaw"}
    assert (
        "heading is +10." in mount_findings(turned)["frame_yaw"]
        or "+9." in mount_findings(turned)["frame_yaw"]
    )
    assert set(mount_findings(ahead)) == {"frame_pivot"}
    assert mount_report(ahead)["mount.x_mm"] == pytest.approx(30.0, abs=1.0)
    assert mount_report(turned)["mount.yaw_deg"] == pytest.approx(10.0, abs=0.3)


def test_a_heading_that_is_plainly_wrong_is_a_problem_and_a_place_is_none() -> None:
    turned = watching(Mount(0.0, 0.0, math.radians(10.0)))
    assert mount_problem(turned, stops=True).endswith(": stopped; calibrate its mount")
    assert "driven all the same, as controller.mount_check is 'warn'" in mount_problem(turned, stops=False)
    assert mount_problem(watching(Mount(0.03, 0.0, 0.0)), stops=True) == ""


def driven(path: Path, *overrides: str) -> Log:
    given = ["run.duration_s=5", "mocap.follower_mount=[0, 0, 0.3]", *overrides]
    run_lockstep(load_scenario("turtlebot3", given), path)
    return read_log(path)


def last_report(log: Log) -> dict[str, str]:
    statuses = [
        status
        for record in log.records([topics.DIAGNOSTICS])
        for status in decode_as(record.payload, DiagnosticArray).status
        if status.name == "abreast/estimator"
    ]
    return {value.key: value.value for value in statuses[-1].values} | {"message": statuses[-1].message}


def test_a_follower_with_a_wrong_heading_is_stopped_and_the_cause_is_named(tmp_path: Path) -> None:
    log = driven(tmp_path / "stop.mcap")
    estimates = [
        decode_as(record.payload, LeaderEstimate) for record in log.records(["follower/leader_estimate"])
    ]
    assert estimates[-1].reason == REASON
    commands = [decode_as(record.payload, Command) for record in log.records(["follower/command"])]
    assert {(command.v2, command.u2) for command in commands[-100:]} == {(0.0, 0.0)}
    report = last_report(log)
    assert report["status"] == "rejecting"
    assert "finding.frame_yaw" in report
    assert report["message"].endswith(": stopped; calibrate its mount")


def test_warned_of_or_set_right_it_drives_on(tmp_path: Path) -> None:
    for name, override, said in (
        ("warn.mcap", "controller.mount_check=warn", True),
        ("right.mcap", "follower.mount=[0, 0, 0.3]", False),
    ):
        log = driven(tmp_path / name, override)
        reasons = {
            decode_as(record.payload, LeaderEstimate).reason
            for record in log.records(["follower/leader_estimate"])
        }
        assert REASON not in reasons
        assert ("finding.frame_yaw" in last_report(log)) is said


def test_the_leaders_mount_and_the_followers_place_beside_its_axis_are_named_live(tmp_path: Path) -> None:
    given = ["run.duration_s=12", "mocap.leader_mount=[0.03, 0, 0.2]", "mocap.follower_mount=[0, 0.04, 0]"]
    run_lockstep(load_scenario("turtlebot3", given), tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap")
    report = last_report(log)
    for name, true in (("leader_yaw", 0.2 * 180.0 / math.pi), ("leader_x", 30.0), ("y", 40.0)):
        unit = "deg" if name == "leader_yaw" else "mm"
        sd = float(report[f"mount.{name}_sd_{unit}"])
        assert float(report[f"mount.{name}_{unit}"]) == pytest.approx(true, abs=5.0 * sd)
    assert report["finding.frame_yaw"].startswith("the leader's heading is +11.")
    assert "the leader's body sits +" in report["finding.frame_pivot"]
    assert "further left of the wheels' middle than follower.mount says" in report["finding.frame_pivot"]
    # Nobody is stopped for what the leader's body does.
    records = log.records(["follower/leader_estimate"])
    assert REASON not in {decode_as(record.payload, LeaderEstimate).reason for record in records}


def test_a_leader_whose_heading_never_changes_has_none() -> None:
    watch, pose, noise = UNWATCHED, Pose(0.0, 0.0, 1.0), PoseNoise(3e-4, 3.5e-3)
    for k in range(600):
        pose = advance(pose, 0.1, 0.6 * math.sin(0.02 * k), 1.0 / 120.0)
        at_ns = round(1e9 * k / 120)
        watch = with_leader(watch, at_ns, Pose(pose.x, pose.y, 0.0), Mount(0.0, 0.0, 0.0), noise)
    assert mount_report(NO_MOUNT_CHECK, watch.check) == {}
    turning, pose = UNWATCHED, Pose(0.0, 0.0, 1.0)
    for k in range(600):
        pose = advance(pose, 0.1, 0.6 * math.sin(0.02 * k), 1.0 / 120.0)
        known = Mount(0.02, -0.01, 0.4)
        turning = with_leader(turning, round(1e9 * k / 120), body_pose(pose, known), known, noise)
    assert mount_report(NO_MOUNT_CHECK, turning.check)["mount.leader_yaw_deg"] == pytest.approx(0.0, abs=0.1)
    assert mount_findings(NO_MOUNT_CHECK, turning.check) == {}
