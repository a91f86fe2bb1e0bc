"""The pages of comparisons and of judged logs, as a browser shows them without a network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select

from hil.compare.compare_page import compare_page
from hil.compare.comparison import compared
from hil.compare.gathering import groups_of
from hil.compare.ratio_maps import map_labels, ratio_maps
from hil.reports.logs_report import logs_report
from tests.hil.reports.conftest import browser as browser
from tests.hil.reports.open_page import open_page
from tests.reference_logs import path_of


def page_of(paths: list[Path], folder: Path) -> Path:
    file = folder / "compare.html"
    file.write_text(compare_page(compared(groups_of(paths))), encoding="utf-8")
    return file


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 1280])
def test_courses_are_drawn_over_each_other(browser: Chrome, tmp_path: Path, width: int) -> None:
    page = page_of([path_of("plain-ekf"), path_of("rough-ukf")], tmp_path)
    seen = open_page(browser, page, width)
    assert (seen.errors, seen.fetched, seen.width) == ([], [], width)
    assert len(seen.inks) == 7, "distance, two errors, two bearings, two commands"
    assert min(seen.inks) > 1, "lines of two colours"


def sweep(folder: Path, errors: dict[float, float], diverged: int = 0) -> Path:
    """A sweep of one estimator over position noise; in its last cell so many of four runs diverged."""
    cells: list[dict[str, Any]] = [
        {
            "sigma_position": position,
            "sigma_heading": 0.01,
            "latency_s": latency,
            "loss": 0.0,
            "estimator": "ekf",
            "runs": 4,
            "samples": 100,
            "diverged": 0,
            "rmse": {"v1": (1.0 + latency) * error},
        }
        for latency in (0.0, 1.0)
        for position, error in errors.items()
    ]
    cells[-1]["diverged"] = diverged
    folder.mkdir()
    (folder / "results.json").write_text(json.dumps({"spec": {}, "cells": cells}))
    return folder


@pytest.fixture
def sweeps(tmp_path: Path) -> list[Path]:
    first = sweep(tmp_path / "first", {0.001: 1.0, 0.002: 2.0})
    return [first, sweep(tmp_path / "other", {0.001: 0.5, 0.002: 2.0}, diverged=3)]


def test_maps_tell_ratios_and_give_no_colour_to_what_diverged(sweeps: list[Path]) -> None:
    first, other = groups_of(sweeps)
    (panel,) = ratio_maps(first, other, ["v1"])
    data = panel.plot.attributes["renderers"][0].attributes["data_source"].attributes["data"]
    assert (data["text|v1|0"], data["text|v1|1"]) == (["0.50", "1.00"], ["0.50", "0 → 3 ✕"])
    assert data["fill|v1|0"][0] == "#0072b2", "half is better by all that the scale has"
    red, green, blue = (data["fill|v1|1"][1][n : n + 2] for n in (1, 3, 5))
    assert red == green == blue


def test_laws_are_shown_by_the_station_first(sweeps: list[Path]) -> None:
    cell = {
        "formation": {"deviation": {"rho": 0.001}, "equilibrium_deviation": {"rho": 0.01}},
        "rmse": {"v1": 1.0},
    }
    assert list(map_labels([cell], laws_differ=True)) == ["station", "v1"]
    assert list(map_labels([cell], laws_differ=False)) == ["v1", "own_run", "station"]
    tree = json.loads((sweeps[1] / "results.json").read_text())
    for off, path in ((0.02, sweeps[0]), (0.01, sweeps[1])):
        for each in tree["cells"]:
            each["formation"] = {"equilibrium_deviation": {"rho": off}}
        (path / "results.json").write_text(json.dumps(tree))
    first, other = groups_of(sweeps)
    (panel,) = ratio_maps(first, other, ["station", "v1"])
    data = panel.plot.attributes["renderers"][0].attributes["data_source"].attributes["data"]
    assert data["text"] == data["text|station|0"] == ["0.50", "0.50"]


@pytest.mark.slow
def test_another_slice_of_two_sweeps_can_be_chosen(
    browser: Chrome, sweeps: list[Path], tmp_path: Path
) -> None:
    seen = open_page(browser, page_of(sweeps, tmp_path), 390)
    assert (seen.errors, seen.width) == ([], 390)
    Select(browser.find_element(By.ID, "slice")).select_by_visible_text("1000 ms, 0 % lost")
    shown = "return Array.from(Bokeh.documents[0].roots()[0].renderers[1].data_source.data.text)"
    assert browser.execute_script(shown) == ["0.50", "0 → 3 ✕"]


@pytest.mark.slow
def test_a_log_is_named_as_it_is_and_its_point_leads_to_its_row(browser: Chrome, tmp_path: Path) -> None:
    """A name may be anything: it is text on the page, and an address in its links."""
    names = ["<b>&.mcap", "a #1.mcap", "plain.mcap"]
    rows = [
        {"log": name, "summary": {"estimation": {"rmse": {"v1": 0.001 * n, "alpha1": 0.1}}}}
        for n, name in enumerate(names, 1)
    ]
    result = {
        "folder": str(tmp_path / "logs"),
        "version": "0",
        "judged": 3,
        "broken": 1,
        "failed": 0,
        "worst": [{"log": names[0], "why": "it is"}],
        "logs": [*rows, {"log": "broken.mcap", "error": "log broken.mcap: is not MCAP"}],
        "wall_s": 1.0,
    }
    file = tmp_path / "report.html"
    file.write_text(logs_report(result, tmp_path), encoding="utf-8")
    seen = open_page(browser, file, 390)
    assert (seen.errors, seen.fetched, seen.width) == ([], [], 390)
    text = browser.find_element(By.TAG_NAME, "body").text
    assert "3 of 4 logs judged, 1 could not be, none failed a check." in text
    assert "<b>&.mcap: it is" in text
    links = [each.get_dom_attribute("href") for each in browser.find_elements(By.LINK_TEXT, "log")]
    assert "logs/%3Cb%3E%26.mcap" in links
    found = "return Array.from(Bokeh.documents[0].roots()[0].renderers[0].data_source.data.href)"
    assert browser.execute_script(found) == ["#log-0", "#log-1", "#log-2"]
    assert browser.find_elements(By.ID, "log-2")
