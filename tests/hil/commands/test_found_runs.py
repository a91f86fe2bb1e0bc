"""Commands that were not told where the lab is, and runs of this machine that they find."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from hil.command_line import main
from hil.commands import stop, wire_options
from hil.commands.found_runs import how_to_stop
from hil.live.runs_here import RunHere, found_here, own_folder
from hil.live.stopping import Stopped
from hil.scenario.files import load_scenario, scenario_text
from hil.scenario.guarded import with_guards
from hil.wire.message_types import String
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, reserved_endpoint
from tests.routers import router
from tests.said_again import again, odometry


class Said(NamedTuple):
    """How a command ended, and what it said."""

    code: object
    out: str
    err: str


class Ran:
    """Runs a command in this process."""

    def __init__(self, captured: pytest.CaptureFixture[str]) -> None:
        self._captured = captured

    def __call__(self, *arguments: str) -> Said:
        code: object = 0
        try:
            main(list(arguments))
        except SystemExit as ended:
            code = ended.code
        return Said(code, *self._captured.readouterr())


@pytest.fixture
def ran(capsys: pytest.CaptureFixture[str]) -> Ran:
    return Ran(capsys)


@pytest.fixture(autouse=True)
def usual(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """A usual endpoint of our own, at which nobody is unless a test lets somebody."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with reserved_endpoint() as endpoint:
        monkeypatch.setattr(wire_options, "DEFAULT_ENDPOINT", endpoint)
        yield endpoint


Begin = Callable[[str], tuple[str, Wire]]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """Begin what others take for a run of robots NAME1 and NAME2: its endpoint, and a wire there."""
    with ExitStack() as held:

        def begun(name: str) -> tuple[str, Wire]:
            robots = f"{name}1", f"{name}2"
            endpoint, wire = held.enter_context(router())
            names = [f"leader.name={robots[0]}", f"follower.name={robots[1]}"]
            path = tmp_path / name / "scenario.toml"
            path.parent.mkdir()
            path.write_text(scenario_text(load_scenario("turtlebot3", names)), encoding="utf-8")
            held.enter_context(found_here(Endpoints(connect=endpoint), path, own_folder()))
            wire.subscribe(["stop"])
            held.enter_context(again(wire, *map(odometry, robots)))
            return endpoint, wire

        yield begun


def stops(wire: Wire) -> set[str]:
    return {
        decode_as(event.payload, String).data
        for event in iter(lambda: wire.inbox.take(0.2), None)
        if event.topic == "stop"
    }


def test_a_stop_without_a_place_stops_all_runs_of_this_machine_at_once(ran: Ran, begin: Begin) -> None:
    wires = [begin(name)[1] for name in ("a", "b")]
    begun = time.monotonic()
    done = ran("stop", "enough")
    assert time.monotonic() - begun < 10.0
    assert (done.code, done.err.count("\n")) == (0, 1), done.err
    assert "no other lab is at tcp/127.0.0.1" in done.err
    assert "a/scenario.toml: a1, a2 told to stand (enough): a1 stands (odometry" in done.out
    assert "b/scenario.toml: b1, b2 told to stand (enough): b1 stands (odometry" in done.out
    assert [stops(wire) for wire in wires] == [{"enough"}, {"enough"}]


def test_whatever_comes_of_one_stop_what_came_of_the_others_is_told(
    ran: Ran, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b"):
        begin(name)
    stopped_run = stop._stopped_run

    def fails(run: RunHere, *given: Any) -> Stopped:
        if "a/scenario.toml" in run.scenario:
            raise RuntimeError("the wire broke")
        return stopped_run(run, *given)

    monkeypatch.setattr(stop, "_stopped_run", fails)
    done = ran("stop", "enough")
    assert done.code == 1
    assert "a/scenario.toml: the wire broke" in done.err
    assert "b/scenario.toml: b1, b2 told to stand (enough): b1 stands" in done.out


def test_a_stop_without_a_place_stops_the_usual_lab_as_well(
    ran: Ran, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, wire = begin("a")
    with router() as (endpoint, lab), again(lab, odometry("leader"), odometry("follower")):
        monkeypatch.setattr(wire_options, "DEFAULT_ENDPOINT", endpoint)
        lab.subscribe(["stop"])
        done = ran("stop")
        assert stops(lab) == {"stopped by hand"}
    assert (done.code, done.err) == (0, "")
    assert f"{endpoint}: leader, follower told to stand" in done.out
    assert stops(wire) == {"stopped by hand"}


def test_a_run_at_the_usual_place_is_stopped_by_its_own_names(
    ran: Ran, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint, _ = begin("a")
    monkeypatch.setattr(wire_options, "DEFAULT_ENDPOINT", endpoint)
    done = ran("stop")
    assert (done.code, done.err) == (0, "")
    assert done.out.count("told to stand") == 1
    status = ran("status", "--once")
    assert "robot a1" in status.out


def test_a_stop_with_a_place_leaves_runs_of_this_machine(ran: Ran, begin: Begin) -> None:
    wire, (endpoint, other) = begin("a")[1], begin("b")
    done = ran("stop", "--connect", endpoint, "--set", "leader.name=b1", "--set", "follower.name=b2")
    assert done.code == 0, done.err
    assert (stops(wire), stops(other)) == (set(), {"stopped by hand"})


def test_a_run_whose_scenario_is_gone_is_stopped_all_the_same(ran: Ran, begin: Begin, tmp_path: Path) -> None:
    _, wire = begin("a")
    (tmp_path / "a" / "scenario.toml").unlink()
    done = ran("stop")
    assert done.code == 1
    assert "robots are told by the names of turtlebot3" in done.err
    assert stops(wire) == {"stopped by hand"}


def test_a_run_with_keys_is_not_passed_over_in_silence(
    ran: Ran, begin: Begin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with reserved_endpoint("tls") as endpoint, monkeypatch.context() as patch:
        patch.setattr(Endpoints, "__post_init__", lambda _: None)
        with found_here(Endpoints(connect=endpoint), tmp_path / "k.toml", own_folder()):
            assert "has keys: give --secure DIR" in ran("status", "--once").err
            _, wire = begin("a")
            done = ran("stop")
    assert done.code == 1
    assert f"k.toml: not stopped, it has keys: give --connect {endpoint} --secure DIR" in done.err
    assert stops(wire) == {"stopped by hand"}


def test_without_a_lab_or_a_run_there_is_nobody_to_stop(ran: Ran) -> None:
    done = ran("stop")
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    assert "no run of yours goes on here: give --connect ENDPOINT of your lab" in done.err


def test_status_shows_the_one_run_of_this_machine_and_asks_which_of_several(ran: Ran, begin: Begin) -> None:
    first, _ = begin("a")
    done = ran("status", "--once")
    assert done.code == 0, done.err
    assert "robot a2" in done.out
    assert f"a/scenario.toml goes on here: --connect {first}" in done.err
    second, _ = begin("b")
    for command in (["status", "--once"], ["live"]):
        done = ran(*command)
        assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
        assert f"give --connect {first} (" in done.err
        assert f"; --connect {second} (" in done.err


def test_the_usual_lab_is_shown_whatever_runs_here(
    ran: Ran, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin("a")
    with router() as (endpoint, _):
        monkeypatch.setattr(wire_options, "DEFAULT_ENDPOINT", endpoint)
        done = ran("status", "--once")
    assert "robot leader" in done.out
    assert done.err == ""


def test_how_to_stop_names_what_is_needed_and_no_more() -> None:
    joining, path = Endpoints(connect="tcp/127.0.0.1:4"), Path("my runs/scenario.toml")
    usual = load_scenario("turtlebot3", ["estimator.kind=ukf", "run.duration_s=7"])
    for each in (usual, with_guards(usual)):
        assert how_to_stop(joining, each, path) == "abreast stop --connect tcp/127.0.0.1:4"
    for key in ("follower.name=f", "controller.command_type=Twist"):
        other = load_scenario("turtlebot3", [key])
        assert how_to_stop(joining, other, path) == (
            "abreast stop --connect tcp/127.0.0.1:4 --scenario 'my runs/scenario.toml'"
        )
