"""Settings of all tests."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

# The same examples every time, so that a red test is a change; HYPOTHESIS_PROFILE=explore looks for new ones.
# How long it takes to draw them depends on what else the machine does.
patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("repeat", patient, derandomize=True, max_examples=60)
settings.register_profile("explore", patient, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeat"))

SLOWEST = (
    "tests/hil/live/test_run.py",
    "tests/estimation/tracking/test_tracker.py",
    "tests/hil/sweep/test_results.py",
    "tests/hil/commands/test_offline_commands.py",
    "tests/hil/replay/test_rerun.py",
    "tests/hil/live/test_daemon.py",
    "tests/hil/test_command_line.py",
    "tests/hil/reports/test_run_report.py",
    "tests/estimation/filters/test_kalman.py",
    "tests/hil/sweep/test_engine.py",
    "tests/hil/lockstep/test_chain_run.py",
)
"""Files whose tests take longest, the longest first: begun last, one would keep a worker busy alone."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the slowest files; all others keep their order."""
    places = {path: place for place, path in enumerate(SLOWEST)}
    items.sort(key=lambda item: places.get(item.nodeid.partition("::")[0], len(places)))
