from __future__ import annotations

from collections.abc import Iterator

import pytest
from selenium.webdriver import Chrome

from tests.hil.live_page.watched_page import begun_browser


@pytest.fixture
def chrome(chromium: Chrome) -> Iterator[Chrome]:
    """The browser, which leaves its page at the end: that would look on at whoever is served there next."""
    yield chromium
    chromium.get("about:blank")


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """Headless Chromium that finds nothing but this machine."""
    found = begun_browser(tmp_path_factory)
    yield found
    found.quit()
