from __future__ import annotations

import itertools
import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import msgspec
import numpy as np
import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

from estimation.tracking.tracker import Status
from hil.figures.plot_data import PlotData
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.summary import summarise
from hil.judge.summary_text import verdict_lines
from hil.log.reader import Log
from hil.nodes.findings import advice_on
from hil.reports.colours import DARK, DARKENED
from hil.reports.filter_plots import latency_panel, status_panel
from hil.reports.plots import TimeAxis, draw_band, table
from hil.reports.run_report import run_report
from hil.wire.message_types import CertifiedEstimate
from hil.wire.messages import to_ns, to_time
from tests.hil.reports.open_page import PATIENCE, open_page

NAN = math.nan
LARGEST_BYTES = 3_000_000
SHADED = '"name":"BoxAnnotation"'


def report(run_data: RunData) -> str:
    return run_report(PlotData.of(run_data), summarise(run_data))


def words(page: str) -> str:
    """What the page says, without scripts, styles and tags."""
    bare = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", bare)).split())


def titles(page: str) -> list[str]:
    return re.findall(r"<h3>(.*?)</h3>", page)


@pytest.fixture(scope="module")
def written(short_log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report(run_data_of_log(short_log)), encoding="utf-8")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 1280])
def test_a_report_opens_without_a_network_and_fits_the_screen(
    browser: Chrome, written: Path, width: int
) -> None:
    assert written.stat().st_size < LARGEST_BYTES
    seen = open_page(browser, written, width)
    assert seen.errors == []
    assert seen.fetched == []
    assert seen.width == width
    assert len(seen.inks) == len(titles(written.read_text(encoding="utf-8"))) == 20
    assert min(seen.inks) > 0  # frames, grids and letters are grey


_AT = """
const named = new Map([...Bokeh.documents[0].all_models].filter(m => m.name).map(m => [m.name, m]));
return [named.get("now").location, named.get("joined").data.x.map(Number),
  named.get("joined").data.y.map(Number), document.querySelector("[data-course='course rho']").textContent];
"""
_COLOURS = """
const plot = Bokeh.documents[0].roots()[0];
return [getComputedStyle(document.body).backgroundColor, plot.below[0].axis_label_text_color];
"""


@pytest.mark.slow
def test_the_slider_moves_robots_and_cursors_and_tells_values(
    browser: Chrome, written: Path, short_log: Log
) -> None:
    open_page(browser, written, 1280)
    slider = browser.find_element(By.ID, "time")
    slider.send_keys(Keys.HOME)
    truth = PlotData.of(run_data_of_log(short_log)).columns.truth
    moment, x, y, rho = browser.execute_script(_AT)
    assert moment == pytest.approx(0.0, abs=0.01)
    start = [truth.leader[0, :2], truth.follower[0, :2]]
    assert [x, y] == [pytest.approx([place[axis] for place in start], abs=0.005) for axis in (0, 1)]
    assert float(rho) == pytest.approx(truth.rho[0], abs=0.005)
    slider.send_keys(Keys.END)
    later, x_later, *_ = browser.execute_script(_AT)
    assert later > moment
    assert x_later != x


@pytest.mark.slow
def test_the_slider_runs_by_itself_until_it_is_stopped(browser: Chrome, written: Path) -> None:
    open_page(browser, written, 390)
    play = browser.find_element(By.ID, "play")
    play.send_keys(Keys.SPACE)
    assert play.get_attribute("aria-label") == "Pause"
    WebDriverWait(browser, PATIENCE).until(lambda b: b.execute_script(_AT)[0] > 0.1)
    play.send_keys(Keys.SPACE)
    assert play.get_attribute("aria-label") == "Play"


@pytest.mark.slow
def test_a_page_and_its_plots_turn_dark_and_back(browser: Chrome, written: Path) -> None:
    open_page(browser, written, 1280)
    before = browser.execute_script(_COLOURS)
    assert before == ["rgb(255, 255, 255)", DARK]
    browser.find_element(By.ID, "theme").click()
    assert browser.execute_script(_COLOURS) == ["rgb(21, 24, 28)", DARKENED[DARK]]
    browser.find_element(By.ID, "theme").click()
    assert browser.execute_script(_COLOURS) == before


def test_headings_are_in_order_links_lead_somewhere_and_text_is_before_scripts(eventful: str) -> None:
    levels = [int(level) for level in re.findall(r"<h(\d)[ >]", eventful)]
    assert levels[0] == 1
    assert max(later - earlier for earlier, later in itertools.pairwise(levels)) == 1
    places = re.findall(r'<a href="#(.*?)"', eventful)
    assert places
    assert [place for place in places if f'id="{place}"' not in eventful] == []
    assert eventful.index("</main>") < eventful.index("<script>")
    assert eventful.count('role="img" aria-label="') == len(titles(eventful))


@pytest.mark.parametrize(("late_ns", "axis"), [(0, "LinearAxis"), (2_000_000_000, "LogAxis")])
def test_the_longest_latency_is_in_the_picture(exact_run_data: RunData, late_ns: int, axis: str) -> None:
    commands = list(exact_run_data.commands)
    first = commands[100]
    issued = to_ns(first.header.stamp)
    commands[100] = replace(first, capture=to_time(issued - late_ns - 5_000_000), fresh=True)
    data = PlotData.of(replace(exact_run_data, commands=commands))
    panel = latency_panel(data, TimeAxis(0.0, 4.0, 0.0))
    assert panel is not None
    assert panel.plot.y_axis.kind == axis
    assert panel.plot.attributes["y_range"].attributes["end"] > (late_ns + 5_000_000) * 1e-6
    assert any(key.label.startswith("largest") for key in panel.keys)


def no_truth(run_data: RunData) -> RunData:
    return replace(run_data, truth=[], commands=[], motion_since_ns=None, frames=None)


def no_estimates(run_data: RunData) -> RunData:
    return replace(run_data, estimates=[])


def nothing(run_data: RunData) -> RunData:
    return replace(no_truth(run_data), estimates=[])


def positions_only(run_data: RunData) -> RunData:
    poses = [replace(each, v1=NAN, u1=NAN, v2=NAN, u2=NAN) for each in run_data.truth]
    return replace(run_data, truth=poses, commands=[], motion_since_ns=None, frames=None)


@pytest.mark.parametrize(
    ("lack", "absent", "present"),
    [
        (
            no_truth,
            ("From above", "Error of", "Commanded", "truth", "noise-free", "RMSE"),
            ("Distance ρ", "NIS"),
        ),
        (positions_only, ("Error of v₁", "Commanded", "noise-free"), ("From above", "Error of α₁")),
        (no_estimates, ("3 σ", "NIS", "Status"), ("From above", "Commanded speed", "noise-free run")),
        (nothing, ("From above", "Distance ρ", "Status", "truth"), ("nothing to judge",)),
    ],
)
def test_what_is_not_known_is_left_out(
    exact_run_data: RunData,
    lack: Callable[[RunData], RunData],
    absent: tuple[str, ...],
    present: tuple[str, ...],
) -> None:
    said = words(report(lack(exact_run_data)))
    assert [each for each in absent if each in said] == []
    assert [each for each in present if each not in said] == []
    assert not re.search(r"\b(nan|None|inf)\b", said)


@pytest.mark.slow
def test_the_same_run_gives_the_same_report(written: Path, short_log: Log) -> None:
    assert report(run_data_of_log(short_log)) == written.read_text(encoding="utf-8")


EVIL = "</title></script><script>alert(1)</script>"


@pytest.mark.slow
def test_certified_radii_are_drawn_with_the_estimates(exact_run_data: RunData) -> None:
    certified = [
        CertifiedEstimate(each.header, each.computed, each.v1, 0.02, each.alpha1, 0.3, 50, "")
        for each in exact_run_data.estimates
    ]
    said = words(report(replace(exact_run_data, certified=certified)))
    assert "Certified radius: up to 20 mm/s" in said
    assert "radius of v₁, median 20 mm/s" in said


@pytest.fixture(scope="module")
def eventful(exact_run_data: RunData) -> str:
    """Report of a run with three samples outside their bounds, stops, estimates lost, and hostile texts."""
    estimates = [
        replace(each, bound_v1=0.009, bound_alpha1=0.09, bound_h=math.inf)
        for each in exact_run_data.estimates
    ]
    commands = list(exact_run_data.commands)
    for number in (100, 150, 151):
        estimates[number] = replace(
            estimates[number], v1=estimates[number].v1 + 0.01, alpha1=estimates[number].alpha1 + 0.1
        )
    for number in range(24):
        estimates[number] = replace(estimates[number], status=int(Status.LOST))
    for number in range(60, 90):
        commands[number] = replace(commands[number], v2=0.0, u2=0.0, stop="stale</script><b>", fresh=False)
    named = msgspec.structs.replace(exact_run_data.scenario, name=EVIL)
    run_data = replace(exact_run_data, scenario=named, estimates=estimates, commands=commands)
    certificate = {"h": {"sound": 0.25, "assumes": ["calm", "order"]}, "k_u_star": {"why": "<too fast>"}}
    summary = summarise(run_data) | {"certificate": certificate, "weather": {"wind": [0.5, 0.25]}}
    summary["rejected"] = {"gated": 1, "swapped": 2}
    return run_report(PlotData.of(run_data), summary)


def test_the_head_says_what_was_run_and_how_it_went(eventful: str) -> None:
    assert f"{EVIL} · ekf · seed 1 · lockstep" in words(eventful)
    assert "Bounds: published ones violated 6 times, extended ones" in words(eventful)
    assert "✗ bad: bounds published ones violated 6 times, extended ones" in words(eventful)
    assert 'class="verdict bad"' in eventful
    assert "inputs refused: gated 1, swapped 2" in words(eventful)


def test_violations_are_told_and_marked(eventful: str) -> None:
    assert words(eventful).count("violated (3)") == 2
    assert words(eventful).count("Violated in 3 of ") == 2
    assert eventful.count('"marker":{"type":"value","value":"x"}') == 2


def test_bounds_in_pictures_are_those_of_the_verdict(short_log: Log) -> None:
    run_data = run_data_of_log(short_log)
    summary = summarise(run_data)
    said = words(run_report(PlotData.of(run_data), summary))
    median = summary["bounds"]["published"]["median"]
    assert f"Published bound: {1e3 * median['v1']:.3g} mm/s (median;" in said
    assert f"Published bound: {math.degrees(median['alpha1']):.3g} deg (median;" in said
    (told,) = (text for name, text, _ in verdict_lines(summary) if name == "bounds")
    assert f"v1 within {1e3 * median['v1']:.1f} mm/s" in told


def test_where_no_bounds_were_published_those_in_pictures_say_what_they_rest_on(
    exact_run_data: RunData,
) -> None:
    estimates = [
        replace(each, bound_v1=NAN, bound_alpha1=NAN, bound_h=NAN) for each in exact_run_data.estimates
    ]
    said = words(report(replace(exact_run_data, estimates=estimates)))
    assert "Bound by the largest errors seen: " in said
    assert "ublished bound: " not in said


def test_stops_and_statuses_are_told(eventful: str) -> None:
    assert re.search(r"stale\S* 1.03 1.53 30 ", words(eventful))
    assert re.search(r"tracking 90.0%, lost 10.0%", words(eventful))


def test_texts_cannot_smuggle_anything_into_the_page(eventful: str) -> None:
    assert "<script>alert" not in eventful
    assert "</script><b>" not in eventful


def test_the_certificate_tells_what_it_guarantees_or_why_not(eventful: str) -> None:
    assert "How far h errs at most 14.32 deg/s" in words(eventful)
    assert "Turn rate up to which Prop. 3 holds, k_u* nothing is guaranteed: <too fast>" in words(eventful)
    assert "calm How far h errs order How far h errs" in words(eventful)


def test_figures_of_other_parts_are_listed_under_their_names(eventful: str) -> None:
    assert "weather, wind 0.5; 0.25" in words(eventful)


def test_a_report_is_written_without_the_python_classes_of_the_plotting_library() -> None:
    loads = "import sys, hil.commands.run, hil.commands.replay, hil.reports.run_report"
    subprocess.run([sys.executable, "-c", f"{loads}; sys.exit('bokeh' in sys.modules)"], check=True)


def test_commands_load_what_draws_only_when_they_draw() -> None:
    loads = "import sys, hil.command_line, hil.commands.run, hil.commands.replay, hil.commands.daemon"
    subprocess.run([sys.executable, "-c", f"{loads}; sys.exit('matplotlib' in sys.modules)"], check=True)


def test_what_was_found_is_told_with_what_to_do(exact_run_data: RunData) -> None:
    found = {"estimator": {"odometry_silent": "no odometry for <3 s>"}}
    page = report(replace(exact_run_data, found=found))
    assert f"odometry silent no odometry for <3 s>; {advice_on('odometry_silent')}" in words(page)
    assert "! look again: findings odometry silent" in words(page)
    assert "<3 s>" not in page
    assert "[{" not in words(page)


def test_statuses_are_drawn_from_when_they_were_told(exact_run_data: RunData) -> None:
    estimates = list(exact_run_data.estimates)
    for row in range(120, 180):  # told for a second, all of the last frame before
        estimates[row] = replace(estimates[row], header=estimates[119].header, status=int(Status.LOST))
    panel = status_panel(PlotData.of(replace(exact_run_data, estimates=estimates)), TimeAxis(0.0, 4.0, 0.0))
    assert panel is not None
    assert "tracking 74.9%, lost 25.1%" in panel.says
    bars = [each.attributes["data_source"].attributes["data"] for each in panel.plot.attributes["renderers"]]
    (lost,) = [each for each in bars if each["row"] == ["lost"]]
    assert [*lost["from"], *lost["to"]] == [pytest.approx(2.0, abs=0.01), pytest.approx(3.0, abs=0.01)]


def test_bands_are_broken_where_lines_are() -> None:
    t = np.array([0.0, 0.1, 0.2, 2.0, 2.1])
    axis = TimeAxis(0.0, 3.0, 0.0)
    whole, broken = axis.panel("y", (0.0, 1.0)), axis.panel("y", (0.0, 1.0))
    draw_band(whole, table(t[:3], t[:3], {"low": t[:3], "high": 1.0 + t[:3]}), "low", "high", DARK)
    draw_band(broken, table(t, t, {"low": t, "high": 1.0 + t}), "low", "high", DARK)
    (area,) = whole.attributes["renderers"]
    assert area.attributes["glyph"].kind == "VArea"
    (patch,) = broken.attributes["renderers"]
    assert patch.attributes["glyph"].kind == "Patch"
    held = patch.attributes["data_source"].attributes["data"]
    nan = math.nan
    assert held["x"] == pytest.approx(
        [nan, 0.0, 0.1, 0.2, 0.2, 0.1, 0.0, nan, 2.0, 2.1, 2.1, 2.0, nan], nan_ok=True
    )
    assert held["y"] == pytest.approx(
        [nan, 0.0, 0.1, 0.2, 1.2, 1.1, 1.0, nan, 2.0, 2.1, 3.1, 3.0, nan], nan_ok=True
    )


def test_bad_spells_are_told_first_and_shaded_in_all_plots_over_time(exact_run_data: RunData) -> None:
    estimates = list(exact_run_data.estimates)
    for row in range(120, 180):
        estimates[row] = replace(estimates[row], header=estimates[119].header, status=int(Status.LOST))
    page = report(replace(exact_run_data, estimates=estimates))
    said = words(page)
    assert "All bounds held, but there was a bad spell: 2.0 to 3.0 s, no frame used for 1.0 s" in said
    assert "look again: bad spells 2.0 to 3.0 s" in said
    assert said.index("When something was bad, and why") < said.index("From above")
    assert "Bad spells are shaded in red." in said
    assert "Nodes and judge named no cause; see the bad spells ." in said
    assert page.count(SHADED) == len(titles(page)) - 1  # all but the tracks from above
    assert 'id="bad-spells"' in page


def test_a_good_run_has_no_bad_spells(exact_run_data: RunData) -> None:
    page = report(exact_run_data)
    assert "bad spells" not in words(page)
    assert SHADED not in page
