from __future__ import annotations

import math
import re
from html import unescape
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from bokeh.palettes import Cividis256
from selenium.webdriver import Chrome
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

from hil.reports.heat_maps import MERITS, Merit, heat_maps
from hil.reports.sweep_report import sweep_report
from tests.hil.reports.open_page import PATIENCE, open_page

POSITIONS, HEADINGS = (0.0001, 0.001, 0.005), (0.002, 0.035)
LATENCIES, LOSSES = (0.0, 0.03, 0.2), (0.0, 0.2)
ESTIMATORS = {"ekf": 1.0, "ukf": 1.05, "difference": 6.0}


def cell(estimator: str, position: float, heading: float, latency: float, loss: float) -> dict[str, Any]:
    """A made-up cell in the form of the contract; the difference estimator breaks sound bounds."""
    error = ESTIMATORS[estimator] * (position + 0.1 * heading) * (1.0 + latency + loss)
    quantities = {"rho_dot": 1.0, "alpha2_dot": 8.0, "v1": 1.2, "alpha1": 9.0, "u1": 90.0}
    names = ("v1", "alpha1", "h", "v1_extended", "alpha1_extended", "h_extended", "paper_alpha1", "paper_h")
    return {
        "sigma_position": position,
        "sigma_heading": heading,
        "latency_s": latency,
        "loss": loss,
        "estimator": estimator,
        "runs": 100,
        "samples": 180_000,
        "diverged": int(estimator == "difference" and loss > 0.1),
        "rmse": {name: error * factor for name, factor in quantities.items()},
        "efficiency": dict.fromkeys(quantities, ESTIMATORS[estimator]),
        "coverage_3sigma": dict.fromkeys(quantities, 0.997),
        "nis_mean": 2.0,
        "bounds": {
            "violations": dict.fromkeys(names, 0) | {"v1": 7 if estimator == "difference" else 0},
            "tightness": dict.fromkeys(names, 0.5) | {"alpha1_extended": 0.3 + 40.0 * position},
        },
        "formation": {"rho_min": 0.19, "rho_max": 0.25, "deviation": {"rho": 0.002}},
    }


@pytest.fixture
def results() -> dict[str, Any]:
    grid = product(ESTIMATORS, POSITIONS, HEADINGS, LATENCIES, LOSSES)
    cells = [cell(*each) for each in grid]
    return {"cells": cells, "run_seconds": 30.0 * 100 * len(cells), "wall_s": 250.0}


def words(page: str) -> str:
    bare = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", bare)).split())


_LETTERS = """
const source = Bokeh.documents[0].roots()[arguments[0]].renderers[1].data_source.data;
return [Array.from(source.row), Array.from(source.column), Array.from(source.text)];
"""


@pytest.mark.slow
def letters(browser: Chrome, plot: int) -> dict[tuple[str, str], str]:
    """What a heat map says now, by position and heading noise."""
    rows, columns, texts = browser.execute_script(_LETTERS, plot)
    return dict(zip(zip(rows, columns, strict=True), texts, strict=True))


@pytest.mark.parametrize("width", [360, 1280])
def test_a_sweep_opens_without_a_network_and_shows_what_is_chosen(
    browser: Chrome, results: dict[str, Any], tmp_path: Path, width: int
) -> None:
    path = tmp_path / "report.html"
    path.write_text(sweep_report(results), encoding="utf-8")
    seen = open_page(browser, path, width)
    assert (seen.errors, seen.fetched, seen.width) == ([], [], width)
    assert len(seen.inks) == 4 * len(ESTIMATORS)
    assert min(seen.inks) > 0  # frames and letters are grey
    at = (f"{1e3 * POSITIONS[1]:g}", f"{math.degrees(HEADINGS[1]):.3g}")
    first = cell("ukf", POSITIONS[1], HEADINGS[1], LATENCIES[0], LOSSES[0])
    assert letters(browser, 1)[at] == f"{1e3 * first['rmse']['v1']:.3g}"
    Select(browser.find_element(By.ID, "quantity")).select_by_value("alpha1")
    Select(browser.find_element(By.ID, "slice")).select_by_visible_text("200 ms, 20 % lost")
    other = cell("ukf", POSITIONS[1], HEADINGS[1], LATENCIES[2], LOSSES[1])
    assert letters(browser, 1)[at] == f"{math.degrees(other['rmse']['alpha1']):.3g}"
    assert letters(browser, 3)[at] == "1.00"
    assert letters(browser, 8)[at] == "1 ✕", "a run of it diverged"
    assert letters(browser, 10)[at] == "2", "off the noise-free run [mm], whatever the quantity"
    assert letters(browser, 7)[at] == "34%"


def test_the_head_is_about_the_estimators_asked_about_and_names_foils(results: dict[str, Any]) -> None:
    said = words(sweep_report(results))
    assert "ekf and ukf: no extended bound violated in 12960000 samples; none of 7200 runs diverged." in said
    assert (
        "difference (a foil): 18 of 3600 runs diverged, in 18 of 36 cells; outside bounds in 252 of" in said
    )
    assert "108 cells, 10800 runs, 19440000 samples" in said
    assert "3.8 days of driving" in said
    foil = results | {"cells": [each for each in results["cells"] if each["estimator"] == "difference"]}
    said = words(sweep_report(foil))
    assert "difference: no extended bound violated in 6480000 samples; 18 of 3600 runs diverged" in said
    assert "foil" not in said, "who asks for a foil alone asks about it"


def test_a_sweep_that_was_broken_off_says_so_first_and_names_no_run_by_a_cell(
    results: dict[str, Any],
) -> None:
    results |= {"interrupted": True, "runs_done": 123}
    results["cells"][0]["worst_run"] = 4
    page = sweep_report(results)
    assert "Broken off after 123 runs. ekf and ukf: " in words(page)
    assert 'class="verdict bad"' in page
    assert "--keep" not in words(page)


def test_a_violated_extended_bound_is_bad(results: dict[str, Any]) -> None:
    assert 'class="verdict bad"' not in sweep_report(results)
    results["cells"][0]["bounds"]["violations"]["h_extended"] = 3
    page = sweep_report(results)
    assert "extended bounds violated in 3 of 12960000 samples" in words(page)
    assert 'class="verdict bad"' in page


def fills(merit: Merit, cells: list[dict[str, Any]], estimator: int) -> dict[str, tuple[str, str]]:
    """Colours of an estimator's map and what stands on them, by what is told under the pointer."""
    source = heat_maps(cells, merit)[estimator].plot.attributes["renderers"][0].attributes["data_source"]
    data = source.attributes["data"]
    return {
        tip: (fill, text)
        for tip, fill, text in zip(data["tip|v1|0"], data["fill|v1|0"], data["text|v1|0"], strict=True)
    }


@pytest.mark.parametrize("merit", MERITS, ids=lambda merit: merit.title)
def test_what_diverged_or_is_empty_is_never_coloured_as_good(results: dict[str, Any], merit: Merit) -> None:
    cells = [each for each in results["cells"] if each["latency_s"] == each["loss"] == 0.0]
    best = {"rmse": {"v1": 0.0}, "efficiency": {"v1": 0.0}}
    lost = {"samples": 0, "bounds": {"tightness": {"v1_extended": 0.0}, "violations": {}}}
    cells[0] |= best | lost | {"diverged": 100}
    cells[1] |= best | lost
    cells[2] |= {"diverged": 7}
    shown = [*fills(merit, cells, 0).values(), *fills(merit, cells, 1).values()]
    sound = {fill for fill, text in shown if "✕" not in text and text != "none"}
    marked = {tip.partition(";")[0]: look for tip, look in fills(merit, cells, 0).items()}
    assert marked["all diverged"][1] == "all ✕"
    assert marked["no estimate tracked"][1] == "none"
    assert marked["diverged"][1] == "7 ✕"
    for name in ("all diverged", "no estimate tracked", "diverged"):
        fill = marked[name][0]
        assert fill not in sound
        assert fill[1:3] == fill[3:5] == fill[5:7], "grey, which no good cell is"
    assert Cividis256[255] in sound, "the scale begins with the best that was judged"


def test_medians_are_over_the_same_cells_for_all_estimators(results: dict[str, Any]) -> None:
    """One that gives up where it is hard must not look good for what is left."""
    for each in results["cells"]:
        if each["estimator"] == "ukf" and each["loss"] > 0.1:
            each |= {"samples": 0, "diverged": 100}
        if each["estimator"] == "ekf":
            each["efficiency"] = {"v1": 3.0 if each["loss"] > 0.1 else 1.0}
    said = words(sweep_report(results))
    assert "ekf 3600 0 18 of 36 1.00" in said
    assert "ukf 3600 1800 18 of 36" in said


def test_a_cell_leads_to_its_kept_run_else_to_its_row(results: dict[str, Any]) -> None:
    cells = results["cells"]
    cells[0]["kept"] = {"3": "cell-0-run-3"}
    page = sweep_report(results)
    assert page.count('id="cell-1"') == 1
    source = heat_maps(cells, MERITS[0])[0].plot.attributes["renderers"][0].attributes["data_source"]
    leads = source.attributes["data"]["href|v1|0"]
    assert leads[0] == "./cell-0-run-3/report.html"
    assert all(lead.startswith("#cell-") for lead in leads[1:])


def test_the_worst_runs_are_linked_where_they_were_kept(results: dict[str, Any]) -> None:
    cells = results["cells"]
    hardest = max(n for n, each in enumerate(cells) if each["estimator"] == "ekf")
    cells[hardest]["bounds"]["tightness"]["h_extended"] = 0.99
    cells[hardest]["worst_run"] = 17
    assert f"--keep {hardest}:17" in words(sweep_report(results))
    cells[hardest]["kept"] = {"17": 'kept/cell "1" 17'}
    page = sweep_report(results)
    assert 'href="./kept/cell%20%221%22%2017/report.html"' in page
    assert 'href="./kept/cell%20%221%22%2017/run.mcap"' in page


def test_what_cells_do_not_know_is_left_out(results: dict[str, Any]) -> None:
    for each in results["cells"]:
        del each["efficiency"], each["formation"], each["nis_mean"]
        each["rmse"] = {} if each["estimator"] == "difference" else each["rmse"]
        each["bounds"] = {}
    said = words(sweep_report(results))
    assert not re.search(r"\b(nan|None|inf)\b", said)
    assert "difference (foil) 3600 18 36 of 36 – – – – – 0 0 0 0" in said


def test_cells_whose_deviations_are_not_what_errors_are_are_counted(results: dict[str, Any]) -> None:
    assert "cells deviations are not" not in words(sweep_report(results))
    for each in results["cells"][:3]:
        each["nees"], each["nees_limits"] = {"v1": 0.25}, {"v1": [0.9, 1.1]}
    said = words(sweep_report(results))
    assert "in 3 of 108 cells deviations are not what errors are" in said
    assert "too modest: v1 0.25 (expected 0.9 to 1.1)" in said


def test_an_empty_sweep_is_a_page_too() -> None:
    assert "0 cells" in words(sweep_report({"cells": [], "run_seconds": 0.0, "wall_s": 0.1}))


@pytest.mark.slow
def test_a_tap_on_a_cell_opens_its_row_or_its_kept_run(
    browser: Chrome, results: dict[str, Any], tmp_path: Path
) -> None:
    kept = tmp_path / "cell-0-run-3"
    kept.mkdir()
    (kept / "report.html").write_text("<title>kept</title>", encoding="utf-8")
    results["cells"][0]["kept"] = {"3": kept.name}
    path = tmp_path / "report.html"
    path.write_text(sweep_report(results), encoding="utf-8")
    open_page(browser, path, 1280)
    plot = browser.find_element(By.ID, "plot0")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    # Right of the middle lies a cell of the second heading noise, in the middle row of three.
    ActionChains(browser).move_to_element_with_offset(plot, plot.size["width"] // 4, -20).click().perform()
    WebDriverWait(browser, PATIENCE).until(lambda b: "#cell-" in b.current_url)
    row = browser.find_element(By.CSS_SELECTOR, ":target")
    assert row.is_displayed(), "the folded table is open"
    # Left of the middle, far down: the least noise of both.
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    ActionChains(browser).move_to_element_with_offset(plot, -plot.size["width"] // 8, 15).click().perform()
    WebDriverWait(browser, PATIENCE).until(lambda b: b.title == "kept")
