"""Runs of robots that exist are judged by their smoothed tracks: held against the emulator's truth."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from formation.angles import wrap
from hil.figures.plot_data import PlotData
from hil.judge.columns import true_states
from hil.judge.mocap_truth import smoothed_truth, tracks_of
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.summary import summarise
from hil.judge.summary_text import verdict_lines, warnings_of
from hil.lockstep.run import run_lockstep
from hil.log.metadata import log_metadata
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.nodes.node import diagnostics
from hil.reports.run_report import run_report
from hil.scenario.files import load_scenario
from hil.scenario.links import Link
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode, typename_of
from hil.wire.topics import topics_of

GIVEN = ["run.duration_s=20.0", "run.evaluate_from_s=12.0"]


def emulated(path: Path, *overrides: str) -> tuple[Log, Scenario]:
    scenario = load_scenario("turtlebot3", [*GIVEN, *overrides])
    run_lockstep(scenario, path)
    return read_log(path), scenario


def as_real(log: Log, scenario: Scenario, path: Path, bodiless: bool = False) -> Log:
    """The log that a recorder would have written if nobody had known the truth, nor emulated anything."""
    since = run_data_of_log(log).motion_since_ns
    with LogWriter(path, log_metadata(scenario, "live")) as writer:
        for record in log.records():
            payload = record.payload
            if record.topic in (topics.TRUTH, topics.LOG):
                continue
            if record.topic == topics.DIAGNOSTICS and b"emulator" in payload:
                said = diagnostics("leader", record.log_ns, "", {"motion_since_ns": since})
                payload = encode(said)
            if record.topic == topics.RIGID_BODIES and bodiless:
                frame = decode_as(payload, msg.RigidBodies)
                nothing = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
                leader = frame.rigidbodies[0]
                pose = msg.Pose(position=leader.pose.position, orientation=nothing)
                bodies = [msg.RigidBody(leader.rigid_body_name, [], pose), frame.rigidbodies[1]]
                payload = encode(dataclasses.replace(frame, rigidbodies=bodies))
            writer.write(record.topic, record.typename, payload, record.log_ns, record.publish_ns)
    return read_log(path)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunData, RunData]:
    """Run data of a run with its truth, and of the same without."""
    folder = tmp_path_factory.mktemp("real")
    log, scenario = emulated(folder / "run.mcap")
    return run_data_of_log(log), run_data_of_log(as_real(log, scenario, folder / "real.mcap"))


def test_figures_are_those_of_the_truth_to_what_a_track_can_tell(both: tuple[RunData, RunData]) -> None:
    known, real = map(summarise, both)
    assert "truth" not in known
    assert real["truth"] == "mocap"
    assert "seed" not in real
    for name, off in (("v1", 0.0015), ("alpha1", math.radians(1.0))):
        assert real["estimation"]["rmse"][name] == pytest.approx(known["estimation"]["rmse"][name], abs=off)
    for name, off in (("rho", 0.001), ("alpha1", math.radians(1.0))):
        orbits = (each["formation"]["orbit_deviation_rms"][name] for each in (real, known))
        assert next(orbits) == pytest.approx(next(orbits), abs=off)
    assert real["duration_s"] == pytest.approx(known["duration_s"], abs=0.05)


@pytest.mark.parametrize("late_s", [0.1, 0.3, 1.0])
def test_a_leader_that_sets_off_later_than_it_was_told_is_judged_the_same(
    both: tuple[RunData, RunData], late_s: float
) -> None:
    real = both[1]
    told = dataclasses.replace(real, motion_since_ns=(real.motion_since_ns or 0) - round(late_s * 1e9))
    found, expected = (summarise(each)["formation"]["orbit_deviation_rms"] for each in (told, real))
    assert found["rho"] == pytest.approx(expected["rho"], abs=0.0003)
    assert found["alpha1"] == pytest.approx(expected["alpha1"], abs=0.01)


def test_what_takes_the_truth_itself_is_not_made_up(both: tuple[RunData, RunData]) -> None:
    summary = summarise(both[1])
    assert not summary["estimation"].keys() & {"efficiency", "coverage_3sigma", "nees", "nees_limits"}
    assert not [line for line in warnings_of(summary) if "too sure" in line or "nees" in line]


def test_it_is_marked_wherever_a_person_looks(both: tuple[RunData, RunData]) -> None:
    known, real = both
    summary = summarise(real)
    assert ("judged", "by the smoothed mocap tracks, whose own errors are in what follows") in [
        line[:2] for line in verdict_lines(summary)
    ]
    page = run_report(PlotData.of(real), summary)
    top, _, parts = page.partition("<main>")
    assert "Judged by the smoothed mocap tracks, whose own errors are in what follows." in top
    assert "<dt>judged</dt><dd>by the smoothed mocap tracks</dd>" in parts
    assert "</span>smoothed mocap</li>" in parts, "the legend of the plots"
    assert "smoothed mocap" not in run_report(PlotData.of(known), summarise(known))


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["mocap.leader_mount=[0.0, 0.0, 1.2]"],
        ["mocap.leader_mount=[0.03, 0.0, 0.0]", "leader.mount=[0.03, 0.0, 0.0]"],
        ["mocap.follower_mount=[0.03, -0.01, 0.3]", "follower.mount=[0.03, -0.01, 0.3]"],
        ["mocap.clock_offset_s=250.0", "estimator.clock=estimated", "estimator.transport_latency_s=0.03"],
        ["bodiless"],
    ],
    ids=[
        "as it is",
        "a body that looks aside",
        "ahead of the axis",
        "a mounted follower",
        "clock",
        "a point",
    ],
)
def test_the_track_is_that_of_the_robots(tmp_path: Path, overrides: list[str]) -> None:
    bodiless = "bodiless" in overrides
    log, scenario = emulated(tmp_path / "run.mcap", *(each for each in overrides if each != "bodiless"))
    tracks = tracks_of(as_real(log, scenario, tmp_path / "real.mcap", bodiless), Link(scenario))
    assert tracks is not None
    found, data = smoothed_truth(tracks, scenario), run_data_of_log(log)
    true = true_states(data)
    since = data.motion_since_ns or 0
    at_ns = found.capture_ns[(found.capture_ns > since + 2e9) & (found.capture_ns < since + 19e9)]
    assert len(at_ns) > 2000
    found, true = found.at(at_ns), true.at(at_ns)

    def off(name: str) -> float:
        errors = getattr(found, name) - getattr(true, name)
        return float(np.sqrt(np.mean(np.square(wrap(errors) if name.startswith("alpha") else errors))))

    assert off("rho") < 0.0005
    assert off("v1") < 0.0015
    assert off("alpha1") < math.radians(1.0)
    assert off("v2") < 0.003
    assert off("u1") < 0.08


def test_a_log_with_hardly_a_frame_has_no_track(tmp_path: Path) -> None:
    scenario = load_scenario("turtlebot3")
    with LogWriter(tmp_path / "run.mcap", log_metadata(scenario, "live")) as writer:
        stop = msg.String(data="enough")
        writer.write(topics.STOP, typename_of(stop), encode(stop), 1, 1)
    log = read_log(tmp_path / "run.mcap")
    assert tracks_of(log, Link(scenario)) is None
    assert "truth" not in summarise(run_data_of_log(log))


def test_the_names_are_those_of_the_bodies(tmp_path: Path) -> None:
    log, scenario = emulated(tmp_path / "run.mcap", "leader.body=1", "follower.body=2", "run.duration_s=2.0")
    assert topics_of(scenario).follower == "follower"
    assert tracks_of(log, Link(scenario)) is not None
