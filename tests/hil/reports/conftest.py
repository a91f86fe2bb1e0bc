from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from selenium.common.exceptions import WebDriverException
from selenium.webdriver import Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service

from tests.hil.reports.open_page import PATIENCE

QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """Headless Chromium that reaches no network."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium chromium-driver")
    chrome = started(chromium, driver, tmp_path_factory)
    chrome.set_script_timeout(PATIENCE)
    chrome.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    chrome.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    yield chrome
    chrome.quit()


def started(chromium: str, driver: str, folders: pytest.TempPathFactory) -> Chrome:
    """A new browser. Its driver picks a port before it listens there, so the port may be gone: try again."""
    for _ in range(2):
        with suppress(WebDriverException):
            return Chrome(options(chromium, folders.mktemp("chromium")), Service(driver))
    return Chrome(options(chromium, folders.mktemp("chromium")), Service(driver))


def options(chromium: str, profile: Path) -> ChromeOptions:
    chosen = ChromeOptions()
    chosen.binary_location = chromium
    for argument in (*QUIET, f"--user-data-dir={profile}"):
        chosen.add_argument(argument)
    chosen.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return chosen
