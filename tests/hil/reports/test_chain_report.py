from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import Chrome

from hil.judge.chain_pairs import driven_trajectory
from hil.judge.chain_summary import summarise_chain
from hil.judge.run_data import RunData, run_data_of_link
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.reports.chain_report import chain_report
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from tests.hil.reports.open_page import open_page
from tests.hil.reports.test_run_report import words

SHORT = ["run.duration_s=2.0", "run.evaluate_from_s=1.0", "chain.agents=4", "mocap.rate_hz=50"]


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, list[RunData], dict[str, Any]]:
    scenario = load_scenario("chain5-turtlebot3", SHORT)
    path = tmp_path_factory.mktemp("chain") / "run.mcap"
    run_lockstep(scenario, path)
    log = read_log(path)
    runs = [run_data_of_link(log, link) for link in links_of(scenario)]
    return scenario, runs, summarise_chain(scenario, runs)


@pytest.mark.parametrize("width", [390, 1280])
def test_a_chain_has_one_page_with_all_of_it(
    browser: Chrome, driven: tuple[Scenario, list[RunData], dict[str, Any]], tmp_path: Path, width: int
) -> None:
    scenario, runs, summary = driven
    page = chain_report(scenario, runs, driven_trajectory(runs), summary)
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    seen = open_page(browser, path, width)
    assert (seen.errors, seen.fetched, seen.width) == ([], [], width)
    assert len(seen.inks) == 6
    assert min(seen.inks) > 0
    for pair in summary["pairs"]:
        assert pair["follower"] in words(page)
    assert page.count('"name":"track ') == 4


def test_a_follower_that_waits_for_its_predecessor_is_not_told_of_as_standing(
    driven: tuple[Scenario, list[RunData], dict[str, Any]],
) -> None:
    scenario, runs, summary = driven
    assert any(run_data.commands[0].stop for run_data in runs)
    assert [pair["commands"]["stopped"] for pair in summary["pairs"]] == [0, 0, 0]
    assert "stand still" not in words(chain_report(scenario, runs, None, summary))


def test_a_chain_that_a_replay_does_not_repeat_or_whose_bounds_broke_is_bad(
    driven: tuple[Scenario, list[RunData], dict[str, Any]],
) -> None:
    scenario, runs, summary = driven
    assert 'class="verdict bad"' not in chain_report(scenario, runs, None, summary)
    differs = summary | {"parity": {"estimates": {"compared": 9, "mismatched": 2}}}
    page = chain_report(scenario, runs, None, differs)
    assert 'class="verdict bad"' in page
    assert "9 messages compared, 2 differ" in words(page)
    first = summary["pairs"][0]
    violated = first | {"bounds": first["bounds"] | {"violations": {"v1_extended": 3}}}
    broken = summary | {"pairs": [violated, *summary["pairs"][1:]]}
    page = chain_report(scenario, runs, None, broken)
    assert 'class="verdict bad"' in page
    assert f"Bounds were violated by {first['follower']}" in words(page)


def test_without_truth_there_is_no_picture_but_what_each_did(
    driven: tuple[Scenario, list[RunData], dict[str, Any]],
) -> None:
    scenario, runs, summary = driven
    page = chain_report(scenario, runs, None, summary)
    assert not re.search(r"<figure", page)
    assert "Followers" in words(page)


def test_a_chain_of_real_robots_says_under_its_verdict_what_it_is_judged_by(
    driven: tuple[Scenario, list[RunData], dict[str, Any]],
) -> None:
    scenario, runs, summary = driven
    assert "Judged" not in chain_report(scenario, runs, None, summary)
    real = summary | {"pairs": [pair | {"truth": "mocap"} for pair in summary["pairs"]]}
    top = chain_report(scenario, runs, None, real).partition("<main>")[0]
    assert top.count("Judged by the smoothed mocap tracks") == 1
