"""Settings of all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# The same examples every time, so that a red test is a change; HYPOTHESIS_PROFILE=explore looks for new ones.
# How long it takes to draw them depends on what else the machine does.
patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("repeat", patient, derandomize=True, max_examples=60)
settings.register_profile("explore", patient, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeat"))

SLOWEST = (
    "tests/docs/test_commands.py",
    "tests/hil/live/test_run.py",
    "tests/estimation/tracking/test_tracker.py",
    "tests/hil/sweep/test_results.py",
    "tests/hil/commands/test_offline_commands.py",
    "tests/hil/replay/test_rerun.py",
    "tests/hil/live/test_daemon.py",
    "tests/hil/test_command_line.py",
    "tests/hil/reports/test_run_report.py",
    "tests/estimation/filters/test_kalman.py",
    "tests/hil/lockstep/test_flyer.py",
    "tests/hil/lockstep/test_chain_run.py",
)
"""Files whose tests take longest, the longest first: begun last, one would keep a worker busy alone."""


@pytest.fixture(scope="session", autouse=True)
def runs_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test finds, and stops, the runs of another worker or of whoever runs the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what needs recordings that are not at hand; begin with the slowest files."""
    if "ABREAST_REAL" not in os.environ:
        left_out = [item for item in items if item.get_closest_marker("real")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
    places = {path: place for place, path in enumerate(SLOWEST)}
    items.sort(key=lambda item: places.get(item.nodeid.partition("::")[0], len(places)))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where ABREAST_NO_SKIPS is set, as in CI, a test that was skipped is one that failed."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if "ABREAST_NO_SKIPS" not in os.environ or reporter is None:
        return
    for report in reporter.stats.get("skipped", ()):
        reporter.write_line(f"skipped, which ABREAST_NO_SKIPS forbids: {report.nodeid}")
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED
