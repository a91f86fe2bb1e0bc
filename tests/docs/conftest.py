"""The browser of the reports, for the site."""

from tests.hil.reports.conftest import browser as browser
