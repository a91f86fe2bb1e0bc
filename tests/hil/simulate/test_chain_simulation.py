"""The paper's chain of five: who is held back by the speed limit, who recovers, and when."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from hil.errors import CheckFailedError, UsageError
from hil.scenario.files import load_scenario
from hil.scenario.schema import ConstantProgram, Scenario
from hil.simulate.chain_simulation import simulate_chain_of


def report_of(name: str, *overrides: str, agents: int = 5, out: Path | None = None) -> dict[str, Any]:
    return simulate_chain_of(load_scenario(name, overrides), agents, out).report


def at_a_speed_of(v: float) -> Scenario:
    """The chain behind a leader of a speed that no scenario may have."""
    chain = load_scenario("chain5")
    return replace(chain, leader=replace(chain.leader, program=ConstantProgram(v=v)))


@pytest.fixture(scope="module")
def literal() -> list[dict[str, float]]:
    pairs: list[dict[str, float]] = report_of("chain5")["pairs"]
    return pairs


def test_outer_agents_saturate_the_earlier_the_further_out(literal: list[dict[str, float]]) -> None:
    assert literal[0]["saturated_from_s"] is None
    moments = [pair["saturated_from_s"] for pair in literal[1:]]
    assert moments == pytest.approx([3.825, 3.52, 3.335], abs=0.011)
    assert [pair["v_peak"] for pair in literal] == pytest.approx([1.0] * 4, abs=1e-9)


def test_pairs_two_and_three_settle_and_agent_five_does_not(literal: list[dict[str, float]]) -> None:
    assert literal[0]["settle_s"] == 0.0
    assert (literal[1]["settle_s"], literal[2]["settle_s"]) == pytest.approx((29.0, 81.0), rel=0.005)
    assert literal[3]["settle_s"] is None
    assert literal[3]["rho_final"] == pytest.approx(44.39, abs=0.01)
    assert [pair["rho_final"] for pair in literal[:3]] == pytest.approx([0.5] * 3, abs=1e-6)


def test_all_recover_where_the_follower_may_turn_towards_its_predecessor() -> None:
    report = report_of("chain5-recovering")
    assert report["recovered"] is True
    settled = [pair["settle_s"] for pair in report["pairs"]]
    assert settled == sorted(settled)
    assert settled[-1] < 30.0


def test_files_hold_every_agent(tmp_path: Path) -> None:
    report = report_of("chain5", "run.duration_s=2.0", agents=3, out=tmp_path)
    with (tmp_path / "trajectory.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 201
    assert [float(rows[-1][f"rho_{k}_{k + 1}"]) for k in (1, 2)] == [
        pair["rho_final"] for pair in report["pairs"]
    ]
    assert float(rows[0]["y_3"]) == pytest.approx(-1.5)
    assert (tmp_path / "chain.png").read_bytes().startswith(b"\x89PNG")


def test_a_long_chain_is_written_more_coarsely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.simulate.track_table.MOST_WRITTEN", 3000)
    report_of("chain5", "run.duration_s=5.0", agents=20, out=tmp_path)
    lines = (tmp_path / "trajectory.csv").read_text().splitlines()
    assert 2 <= len(lines) - 1 <= 3000 // 157
    assert [line.partition(",")[0] for line in (lines[1], lines[-1])] == ["0.0", "5.0"]


def test_mistakes_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"chain\.agents.*1"):
        load_scenario("chain5", ["chain.agents=1"])
    with pytest.raises(UsageError, match="did you mean 'agents'"):
        load_scenario("chain5", ["chain.agent=3"])
    with pytest.raises(UsageError, match=r"controller\.tilt"):
        load_scenario("chain5", ["controller.tilt=1.6"])
    with pytest.raises(CheckFailedError, match="breaks down"):
        simulate_chain_of(at_a_speed_of(1e12), 5, None)
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--out"):
        report_of("chain5", "run.duration_s=0.1", out=tmp_path / "file" / "below")
