"""Settings of all tests: what is left out without real recordings, and that CI lets nothing be skipped."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

SETTINGS = (Path(__file__).parent / "conftest.py").read_text(encoding="utf-8")
TESTS = """
import pytest

def test_plain(): pass

@pytest.mark.real
def test_real(): pass
"""
SKIPPED = """
import pytest

def test_no_browser(): pytest.skip("none here")
"""


@pytest.fixture(autouse=True)
def bare(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with these settings, and nothing set in the environment."""
    pytester.makeconftest(SETTINGS)
    pytester.makeini("[pytest]\nmarkers =\n    real: needs recordings\n")
    for name in ("ABREAST_NO_SKIPS", "ABREAST_REAL", "PYTEST_ADDOPTS", "PYTEST_XDIST_WORKER"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("given", "expected"), [(None, {"passed": 1, "deselected": 1}), (".", {"passed": 2})]
)
def test_recordings_that_are_not_at_hand_are_not_asked_for(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, given: str, expected: dict[str, int]
) -> None:
    if given:
        monkeypatch.setenv("ABREAST_REAL", given)
    pytester.makepyfile(TESTS)
    pytester.runpytest_subprocess("-q").assert_outcomes(**expected)


def test_a_skip_fails_where_none_is_allowed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(SKIPPED)
    assert pytester.runpytest_subprocess("-n1").ret == pytest.ExitCode.OK
    monkeypatch.setenv("ABREAST_NO_SKIPS", "1")
    forbidden = pytester.runpytest_subprocess("-n1")
    assert forbidden.ret == pytest.ExitCode.TESTS_FAILED
    forbidden.stdout.fnmatch_lines(["*ABREAST_NO_SKIPS forbids: *::test_no_browser*"])
