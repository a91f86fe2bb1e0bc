"""A chain from its scenario to its verdict: lockstep, log, replay, summary, picture."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import pytest

from hil.command_line import main
from hil.judge.chain_summary import summarise_chain
from hil.judge.run_data import run_data_of_link
from hil.lockstep.run import run_lockstep
from hil.log.events import Timed, logged_events
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.nodes.link_nodes import estimator_node
from hil.replay.re_execution import execute
from hil.replay.rerun import replay_chain
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.message_types import LeaderEstimate, RigidBodies
from hil.wire.messages import decode_as, encode

GIVEN = ("chain.agents=3", "run.duration_s=3.0", "run.evaluate_from_s=1.5")


class Said(NamedTuple):
    code: object
    stdout: str
    stderr: str


def abreast(*arguments: str) -> Said:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as left:
        main(arguments)
    return Said(left.value.code, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of ``abreast run`` of a chain of three in lockstep."""
    out = tmp_path_factory.mktemp("chain") / "out"
    options = [word for each in GIVEN for word in ("--set", each)]
    result = abreast("run", "chain5-turtlebot3", "--lockstep", "--certify", "--out", str(out), *options)
    assert result.code == 0, result.stderr
    assert "all at their station" in result.stdout
    return out


def test_a_chain_leaves_log_summary_picture_and_page(folder: Path) -> None:
    left = {"run.mcap", "scenario.toml", "summary.json", "run.png", "report.html"}
    assert {path.name for path in folder.iterdir()} == left
    assert load_scenario(str(folder / "scenario.toml")) == scenario_of(read_log(folder / "run.mcap"))
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["agents"], summary["mode"], summary["recovered"]) == (3, "lockstep", True)
    assert [(pair["leader"], pair["follower"]) for pair in summary["pairs"]] == [
        ("leader", "follower"),
        ("follower", "agent3"),
    ]
    for pair in summary["pairs"]:
        assert pair["rho_final"] == pytest.approx(0.2, abs=0.01)
        assert pair["v_peak"] < 0.22
        assert pair["estimation"]["rmse"]["v1"] < 0.01
        assert sum(pair["bounds"]["violations"][name] for name in ("v1_extended", "alpha1_extended")) == 0
        assert [pair["certified"][name]["violations"] for name in ("v1", "alpha1")] == [0, 0]
        # The other robots of the chain are no strangers to it.
        assert "unknown_body" not in pair.get("rejected", {})


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(folder: Path, tmp_path: Path) -> None:
    short = (*GIVEN, "run.duration_s=0.5")
    logs = []
    for number, seed in enumerate((1, 1, 2)):
        run_lockstep(
            load_scenario("chain5-turtlebot3", [*short, f"run.seed={seed}"]), tmp_path / f"{number}.mcap"
        )
        logs.append((tmp_path / f"{number}.mcap").read_bytes())
    assert logs[0] == logs[1] != logs[2]


@pytest.mark.slow
def test_every_follower_repeats_bit_for_bit(folder: Path) -> None:
    result = abreast("replay", str(folder / "run.mcap"), "--verify", "--json")
    assert result.code == 0, result.stderr
    found = json.loads(result.stdout)
    assert [found["parity"][name]["mismatched"] for name in ("estimates", "commands", "certified")] == [0] * 3
    assert found["parity"]["certified"]["compared"] == found["parity"]["estimates"]["compared"]
    assert [pair["parity"]["estimates"]["compared"] > 300 for pair in found["pairs"]] == [True, True]


@pytest.mark.slow
def test_one_follower_of_a_chain_is_replayed_like_a_pair(folder: Path, tmp_path: Path) -> None:
    log, out = folder / "run.mcap", tmp_path / "out"
    given = (str(log), "--follower", "agent3", "--verify", "--out", str(out), "--json")
    result = abreast("replay", *given)
    assert result.code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["scenario"] == "chain5-turtlebot3/agent3"
    assert found["parity"]["estimates"]["mismatched"] == 0
    assert {path.name for path in out.iterdir()} == {
        "summary.json",
        "estimates.csv",
        "replay.png",
        "report.html",
    }


def test_another_estimator_is_tried_on_all_followers(folder: Path) -> None:
    log = read_log(folder / "run.mcap")
    scenario = load_scenario("chain5-turtlebot3", [*GIVEN, "estimator.kind=ukf"])
    played = replay_chain(log, scenario)
    assert [each.link.follower for each in played] == ["follower", "agent3"]
    assert all(len(each.estimates) > 300 and not each.commands for each in played)


def test_a_follower_sees_its_predecessor_and_nobody_else(folder: Path) -> None:
    log = read_log(folder / "run.mcap")
    link = links_of(load_scenario("chain5-turtlebot3", GIVEN))[1]
    node = estimator_node(link)
    events = list(logged_events(log, node.subscribes))[:600]

    def estimates(timed: Iterable[Timed]) -> list[tuple[float, ...]]:
        sent = [message for message in execute(node, timed).outputs if message.topic == node.topics.estimate]
        told = [decode_as(message.payload, LeaderEstimate) for message in sent]
        return [(each.rho, each.alpha2, each.v1, each.alpha1, each.u1) for each in told]

    assert {event.topic for event, _ in events} == {"rigid_bodies", "agent3/odom"}
    seen = estimates(events)
    assert len(seen) > 100
    assert estimates([(moved(event, "leader"), now_ns) for event, now_ns in events]) == seen
    assert estimates([(moved(event, "follower"), now_ns) for event, now_ns in events]) != seen


def moved(event: Event, name: str) -> Event:
    """The same event with one robot elsewhere, if it is a frame."""
    if event.topic != topics.RIGID_BODIES:
        return event
    frame = decode_as(event.payload, RigidBodies)
    for body in frame.rigidbodies:
        if body.rigid_body_name == name:
            body.pose.position.x += 0.5
    return Event(event.topic, encode(frame))


def test_a_chain_away_from_its_stations_is_said_to_be(folder: Path) -> None:
    log, scenario = read_log(folder / "run.mcap"), load_scenario("chain5-turtlebot3", GIVEN)
    links = links_of(scenario)
    far = summarise_chain(
        load_scenario("chain5-turtlebot3", [*GIVEN, "formation.rho_0=0.3"]),
        [run_data_of_link(log, link) for link in links],
    )
    assert far["recovered"] is False
    assert all("settle_s" not in pair for pair in far["pairs"])


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--leader", "leader"), "everybody follows the robot before"),
        (("--follower", "agent9"), "one of: follower, agent3"),
        (("--csv", "x.csv"), "holds the estimates of one follower"),
        (("--set", "chain.agents=4"), r"has 3 agents, expected as many as chain.agents = 4"),
        (("--verify", "--estimator", "ukf"), "leave out what changes them"),
    ],
)
def test_what_a_chain_does_not_have_is_answered(
    folder: Path, options: tuple[str, ...], complaint: str
) -> None:
    result = abreast("replay", str(folder / "run.mcap"), *options)
    assert result.code == 2
    assert complaint in result.stderr
