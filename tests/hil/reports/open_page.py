from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.support.ui import WebDriverWait

PATIENCE = 90.0

_DRAWN = "return window.Bokeh !== undefined && Bokeh.documents.length === 1 && Bokeh.documents[0].is_idle"
_SEEN = """
const canvases = root => [...root.querySelectorAll("*")].flatMap(
  each => each.tagName === "CANVAS" ? [each] : each.shadowRoot ? canvases(each.shadowRoot) : []);
const colours = canvas => {
  if (!canvas.width || !canvas.height) return new Set();
  const pixels = new Uint32Array(
    canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  const grey = pixel => (pixel & 255) === (pixel >> 8 & 255) && (pixel & 255) === (pixel >> 16 & 255);
  return new Set(pixels.filter(pixel => pixel >>> 24 === 255 && !grey(pixel)));
};
return {
  inks: [...document.querySelectorAll("figure")].map(
    figure => Math.max(0, ...canvases(figure).map(canvas => colours(canvas).size))),
  width: document.documentElement.scrollWidth,
  fetched: performance.getEntriesByType("resource").map(entry => entry.name),
};
"""


@dataclass(frozen=True, slots=True)
class Seen:
    """What a browser shows: colours other than grey by figure, width [px], fetched addresses, errors."""

    inks: list[int]
    width: int
    fetched: list[str]
    errors: list[str]


def open_page(browser: Chrome, path: Path, width: int) -> Seen:
    """Open a file as by double click, at a width in pixels, and wait until all is drawn."""
    metrics = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get(path.as_uri())
    WebDriverWait(browser, PATIENCE, poll_frequency=0.1).until(lambda b: b.execute_script(_DRAWN))
    seen = browser.execute_script(_SEEN)
    log = browser.execute("getLog", {"type": "browser"})["value"]
    messages = [str(entry["message"]) for entry in log if entry["level"] != "INFO"]
    return Seen(errors=messages, **seen)
