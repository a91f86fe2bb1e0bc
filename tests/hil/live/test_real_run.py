"""A run with robots that are not ours: another process is the lab, and tells nobody the truth."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from hil.log.reader import read_log
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.messages import decode_as
from hil.wire.session import reserved_endpoint
from tests.hil.live.child_run import PATIENCE, Run
from tests.hil.live.own_poses import off_orbit
from tests.routers import router
from tests.tls_labs import lab_keys

pytestmark = pytest.mark.slow

DURATION, FROM = 20.0, 12.0


GUARD = ("guard", "turtlebot3", "--robot")

Met = tuple[str, list[str]]
"""An endpoint at which all meet, and by which options of a run."""


@contextmanager
def router_of_the_run() -> Iterator[Met]:
    with reserved_endpoint() as endpoint:
        yield endpoint, ["--listen", endpoint]


@contextmanager
def real_run(
    folder: Path,
    lab_options: list[str],
    options: list[str],
    there: Met | None = None,
    keys: tuple[str, ...] = (),
) -> Iterator[tuple[Run, Path]]:
    """A run, and where the lab leaves the robots' own poses once the run is over; ``keys``: for all of it."""
    table = folder / "poses.csv"
    with nullcontext(there) if there else router_of_the_run() as (endpoint, meeting):
        where = [*meeting, "--out", str(folder / "run"), "--json"]
        given = ["--duration", str(DURATION), "--set", f"run.evaluate_from_s={FROM}"]
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", "run", "turtlebot3", "--real", *where, *keys, *given, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        lab = subprocess.Popen(
            [sys.executable, "-m", "tests.hil.live.stranger_lab", endpoint, str(table), *keys, *lab_options]
        )
        commanded = {"leader", "follower"} - {*lab_options[1:], "leader" if "--hand" in lab_options else ""}
        guards = [
            subprocess.Popen([sys.executable, "-m", "hil", *GUARD, robot, "--connect", endpoint, *keys])
            for robot in sorted(commanded)
        ]
        try:
            yield Run(folder / "run", endpoint, process, 0), table
            lab.send_signal(signal.SIGTERM)
            assert lab.wait(30.0) == 0
            for guard in guards:
                guard.send_signal(signal.SIGTERM)
                assert guard.wait(30.0) == 0
        finally:
            processes: list[subprocess.Popen[Any]] = [process, lab, *guards]
            for each in processes:
                if each.poll() is None:
                    each.kill()
                    each.wait()


@pytest.mark.parametrize(
    ("lab", "options"),
    [
        ([], ["--countdown", "0.5"]),
        (["--hand", "4"], ["--leader", "hand"]),
    ],
    ids=["program", "hand"],
)
def test_the_pair_keeps_to_the_orbit_by_its_own_poses_and_by_the_judge(
    tmp_path: Path, lab: list[str], options: list[str]
) -> None:
    with real_run(tmp_path, lab, options) as (run, table):
        code, summary, err = run.finish()
    assert code == 0, err
    assert run.daemons() == {}
    rho, _ = off_orbit(table, load_scenario("turtlebot3"), (FROM, DURATION - 0.5))
    assert rho < 0.003
    assert summary["truth"] == "mocap"
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < 0.003
    assert summary["estimation"]["rmse"]["v1"] < 0.003
    assert summary["duration_s"] == pytest.approx(DURATION, abs=0.5)


@pytest.mark.parametrize("by", ["endpoint", "file"])
def test_a_router_that_is_there_will_do(tmp_path: Path, by: str) -> None:
    with router() as (endpoint, _):
        config = {"mode": "client", "connect": {"endpoints": [endpoint]}}
        (tmp_path / "lab.json5").write_text(json.dumps(config), encoding="utf-8")
        told = (
            ["--connect", endpoint] if by == "endpoint" else ["--zenoh-config", str(tmp_path / "lab.json5")]
        )
        with real_run(tmp_path, [], ["--countdown", "0.5"], (endpoint, told)) as (run, _):
            code, summary, err = run.finish()
    assert code == 0, err
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < 0.003


def test_a_run_its_guards_and_its_lab_meet_by_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    lab_keys(folder)
    with reserved_endpoint("tls") as endpoint:
        there = endpoint, ["--listen", endpoint]
        options = ["--countdown", "0.5"]
        with real_run(tmp_path, [], options, there, ("--secure", str(folder))) as (run, table):
            code, summary, err = run.finish()
    assert code == 0, err
    rho, _ = off_orbit(table, load_scenario("turtlebot3"), (FROM, DURATION - 0.5))
    assert rho < 0.003
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < 0.003


@pytest.mark.parametrize("robot", ["leader", "follower"])
def test_one_robot_may_be_emulated_beside_a_real_one(tmp_path: Path, robot: str) -> None:
    with real_run(tmp_path, ["--without", robot], ["--emulate", robot]) as (run, _):
        code, summary, err = run.finish()
    assert code == 0, err
    assert summary["truth"] == "mocap"
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < 0.003
    assert summary["estimation"]["rmse"]["v1"] < 0.003


def test_when_the_leaders_daemon_is_killed_both_robots_stand(tmp_path: Path) -> None:
    with real_run(tmp_path, [], ["--countdown", "0"]) as (run, table):
        run.wait_until(lambda: "leader" in run.daemons())
        with run.listening("leader/cmd_vel") as wire:

            def drives() -> bool:
                event = wire.inbox.take(0.1)
                return event is not None and decode_as(event.payload, msg.TwistStamped).twist.linear.x > 0.0

            run.wait_until(drives)
        os.kill(run.daemons()["leader"], signal.SIGKILL)
        out, err = run.process.communicate(timeout=PATIENCE)
    assert run.process.returncode == 1
    assert "the leader was killed by signal 9" in err
    assert json.loads(out)["mode"] == "live"
    last = table.read_text(encoding="utf-8").splitlines()[-1].split(",")
    assert abs(float(last[7])) < 0.01
    for topic in ("leader/cmd_vel", "follower/cmd_vel"):
        final = list(read_log(run.log).records([topic]))[-1]
        twist = decode_as(final.payload, msg.TwistStamped).twist
        assert twist.linear.x == twist.angular.z == 0.0
