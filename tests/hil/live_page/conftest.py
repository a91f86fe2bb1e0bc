from __future__ import annotations

from collections.abc import Iterator

import pytest
from selenium.webdriver import Chrome

from tests.hil.live_page.watched_page import begun_browser


@pytest.fixture(scope="session")
def chrome(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """Headless Chromium that finds nothing but this machine."""
    found = begun_browser(tmp_path_factory)
    yield found
    found.quit()
