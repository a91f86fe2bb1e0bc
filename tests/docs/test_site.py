"""The site of the docs: built strictly, without a network, with every page in its navigation."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from docs import command_page
from hil.command_line import abreast
from tests.hil.reports.open_page import PATIENCE

ROOT = Path(__file__).resolve().parent.parent.parent
PAGES = sorted((ROOT / "docs").glob("*.md"))


def build(out: Path) -> subprocess.CompletedProcess[str]:
    """What ``scripts/docs`` says of the docs."""
    words = ["-q", "-W", "--keep-going", "-c", "docs", "-d", str(out / "doctrees"), ".", str(out / "site")]
    return subprocess.run(
        [sys.executable, "-m", "sphinx", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    out = tmp_path_factory.mktemp("docs")
    done = build(out)
    assert done.returncode == 0, done.stderr
    return out / "site"


def test_the_site_is_built_without_a_warning_and_opens_at_its_pages(site: Path) -> None:
    assert "url=docs/index.html" in (site / "index.html").read_text()
    assert {path.stem for path in PAGES} == {path.stem for path in (site / "docs").glob("*.html")}


def test_a_page_asks_nothing_of_a_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        loaded = re.findall(
            r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="(https?:[^"]*)"', page.read_text()
        )
        assert not loaded, (page, loaded)


def test_the_site_is_light(site: Path) -> None:
    images = {path.name: path.stat().st_size for path in (site / "_images").iterdir()}
    assert max(images.values()) < 300_000, images
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < 8_000_000


@pytest.mark.parametrize("page", [path.stem for path in PAGES if path.stem != "index"])
def test_every_page_stands_in_the_navigation_once(page: str) -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    trees = re.findall(r"```\{toctree\}\n(.*?)```", index, re.DOTALL)
    entries = re.findall(r"^(?:.*<)?([\w./]+?)>?$", "\n".join(trees), re.MULTILINE)
    assert entries.count(page) == 1, f"add {page} to the part of docs/index.md that it belongs to"


def test_the_page_of_commands_is_what_the_commands_say() -> None:
    written = command_page.written(abreast, "abreast")
    assert command_page.PAGE.read_text(encoding="utf-8") == written, "run scripts/docs"


@pytest.fixture
def phone(browser: Chrome) -> Iterator[Chrome]:
    """The browser with a screen of 390 by 844 pixels."""
    screen = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_no_page_is_wider_than_a_phone(site: Path, phone: Chrome) -> None:
    wide = {}
    for page in sorted(site.rglob("*.html")):
        phone.get(page.as_uri())
        width = phone.execute_script("return document.documentElement.scrollWidth")
        if width > 390:
            wide[page.name] = width
    assert not wide


def test_the_search_finds_a_key_without_a_server(site: Path, browser: Chrome) -> None:
    browser.get(f"{(site / 'search.html').as_uri()}?q=mount_check")
    WebDriverWait(browser, PATIENCE).until(lambda page: page.find_elements(By.CSS_SELECTOR, ".search li a"))
    found = {each.text for each in browser.find_elements(By.CSS_SELECTOR, ".search li a")}
    assert any("Every key of a scenario" in title for title in found), found
