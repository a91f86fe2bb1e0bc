"""Findings of nodes get into the verdict, of a run, of its replay, and of one follower of a chain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil.judge.findings import findings_list, found_again, of_follower
from hil.judge.replay_verdict import run_data_of_replay
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.summary import summarise
from hil.judge.summary_text import warnings_of
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.nodes.controller import ControllerNode
from hil.nodes.estimator import EstimatorNode
from hil.nodes.findings import advice_on
from hil.replay.log_replay import kept_replays
from hil.replay.rerun import linked, replay
from hil.scenario.files import load_scenario, with_overrides
from hil.scenario.links import Link, links_of

PAIR = load_scenario("turtlebot3", ["run.duration_s=2.0"])
SILENT = {"odometry_silent": "no odometry for 1 s"}


@pytest.fixture
def found_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes that find something in the first second, and then no more."""
    since: list[int] = []

    def findings(_node: object, _state: object, now_ns: int) -> dict[str, str]:
        since.append(now_ns)
        return SILENT if now_ns < min(since) + 1_000_000_000 else {}

    monkeypatch.setattr(EstimatorNode, "findings", findings)
    monkeypatch.setattr(ControllerNode, "findings", lambda *_: {})


@pytest.fixture
def log_of_found(found_early: None, tmp_path: Path) -> Log:
    path = tmp_path / "run.mcap"
    run_lockstep(PAIR, path)
    return read_log(path)


def by_nodes(summary: dict[str, Any]) -> list[dict[str, str]]:
    """Findings without those of the judge itself."""
    return [each for each in summary["findings"] if each["name"] != "nees"]


def names(summary: dict[str, Any]) -> list[str]:
    return [each["name"] for each in by_nodes(summary)]


def test_what_was_found_for_a_while_is_in_the_verdict_of_run_and_replay(
    log_of_found: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = summarise(run_data_of_log(log_of_found))
    (found,) = by_nodes(summary)
    assert found == {"name": "odometry_silent", "text": "no odometry for 1 s", "advice": found["advice"]}
    assert found["advice"] == advice_on("odometry_silent")
    assert [line for line in warnings_of(summary) if "no odometry for 1 s" in line]
    assert names(summarise(run_data_of_replay(log_of_found, replay(log_of_found)))) == ["odometry_silent"]
    kept = kept_replays(log_of_found, linked(log_of_found))
    if kept is not None:
        assert names(summarise(run_data_of_replay(log_of_found, kept[0]))) == ["odometry_silent"]
    # Estimated otherwise, it is only what is found now that counts.
    monkeypatch.setattr(EstimatorNode, "findings", lambda *_: {"noise": "twice as large as told"})
    other = with_overrides(PAIR, ["estimator.kind=ukf"])
    assert names(summarise(run_data_of_replay(log_of_found, replay(log_of_found, other)))) == ["noise"]


def test_a_run_in_which_nothing_was_found_says_so_and_one_without_diagnostics_does_not(
    short_log: Log, exact_run_data: RunData
) -> None:
    assert by_nodes(summarise(run_data_of_log(short_log))) == []
    assert "findings" not in summarise(replace(exact_run_data, truth=[]))
    assert summarise(replace(exact_run_data, truth=[], found={}))["findings"] == []


def test_each_follower_of_a_chain_has_its_own_and_those_of_nobody() -> None:
    first, second = links_of(load_scenario("chain5-turtlebot3", ["chain.agents=3"]))
    found = {
        f"estimator/{first.follower}": SILENT,
        f"controller/{second.follower}": {"command_gaps": "none for 1 s"},
        "emulator": {"clock": "behind"},
    }
    assert set(of_follower(found, first)) == {f"estimator/{first.follower}", "emulator"}
    assert set(of_follower(found, second)) == {f"controller/{second.follower}", "emulator"}


def test_a_replay_with_other_steps_does_not_know_what_was_found_live() -> None:
    logged = {"estimator": SILENT, "recorder": {"disk": "full"}}
    again = {"estimator": {"noise": "twice"}}
    assert found_again(logged, again, Link(PAIR), same=True)["estimator"] == {**SILENT, "noise": "twice"}
    other = found_again(logged, again, Link(PAIR), same=False)
    assert other == {"estimator": {"noise": "twice"}, "recorder": {"disk": "full"}}
    assert found_again(None, again, Link(PAIR), same=False) == again
    assert findings_list(None, None) is None
    assert [each["name"] for each in findings_list(other, None) or ()] == ["noise", "disk"]
