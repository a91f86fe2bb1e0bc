"""The live page in a browser, as somebody in the lab has it before him."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from typing import Any

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from tests.hil.reports.conftest import started

PATIENCE = 120.0

# Colours other than grey on a canvas: what is empty or greyed has none.
_COLOURS = """
return [...document.querySelectorAll("canvas")].map(canvas => {
  if (!canvas.width) return 0;
  const image = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const data = new Uint32Array(image.data.buffer);
  const grey = p => (p & 255) === (p >> 8 & 255) && (p & 255) === (p >> 16 & 255);
  return new Set(data.filter(p => p >>> 24 === 255 && !grey(p))).size;
});
"""


def begun_browser(folders: pytest.TempPathFactory) -> Chrome:
    """A browser; the test is skipped where there is none."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium chromium-driver")
    return started(chromium, driver, folders)


class WatchedPage:
    """A page that is open in a browser of a phone's width."""

    def __init__(self, chrome: Chrome, address: str, width: int = 390) -> None:
        self.chrome = chrome
        metrics = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 500}
        chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        chrome.get("about:blank")
        chrome.execute("getLog", {"type": "browser"})
        chrome.get(address)

    def text(self, name: str) -> str:
        """What stands in an element, by its id."""
        return str(self.script(f"return document.getElementById('{name}').textContent"))

    def script(self, text: str) -> Any:
        """What a script gives."""
        return self.chrome.execute_script(text)

    def is_live(self) -> bool:
        """Whether it says that what it shows is fresh."""
        return bool(self.script("return document.body.dataset.link") == "live")

    def wait_until(self, what: Callable[[], object]) -> None:
        """Wait for something to become true."""
        WebDriverWait(self.chrome, PATIENCE, poll_frequency=0.05).until(lambda _: what())

    def colours(self) -> list[int]:
        """How many colours each picture has."""
        return [int(count) for count in self.script(_COLOURS)]

    def press(self, key: str) -> None:
        """Press a key, wherever the focus is."""
        self.chrome.switch_to.active_element.send_keys(key)

    def click(self, name: str) -> None:
        """Click on an element, by its id."""
        self.chrome.find_element(By.ID, name).click()

    def button(self, text: str) -> Any:
        """A button by what stands on it."""
        found = self.chrome.find_element(By.XPATH, f"//button[normalize-space()='{text}']")
        # Else it may lie behind the bar with the stop button.
        self.chrome.execute_script("arguments[0].scrollIntoView({block: 'center'})", found)
        return found

    def errors(self) -> list[str]:
        """What the browser complained of since the page was opened."""
        log = self.chrome.execute("getLog", {"type": "browser"})["value"]
        said = [str(entry["message"]) for entry in log if entry["level"] != "INFO"]
        # It is our own look at the pictures that is not as fast as could be.
        return [each for each in said if "getImageData" not in each]
