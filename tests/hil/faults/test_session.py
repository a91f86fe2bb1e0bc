"""What is left of tries."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hil.faults import session
from hil.faults.attempt import Try
from hil.faults.fault import Fault
from hil.faults.link import NotHereError
from hil.faults.matrix import faults
from hil.faults.session import Tries, tried

COVERED = next(fault for fault in faults() if not fault.uncovered)
UNCOVERED = next(fault for fault in faults() if fault.uncovered)
MISSING = replace(COVERED, name="missing")


def attempted(fault: Fault, folder: Path, _ros: int | None) -> Try:
    """Of every fault the second try goes wrong."""
    if fault is MISSING:
        raise NotHereError("there is none")
    folder.mkdir(parents=True)
    (folder / "run.err").write_text("what it said", encoding="utf-8")
    return Try(runaway_s=float(folder.name.endswith("-1")))


def test_what_was_said_in_wrong_tries_is_kept_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "attempt", attempted)
    said: list[str] = []
    for _ in range(2):
        found = tried([COVERED, UNCOVERED, MISSING], Tries(3, keep=tmp_path / "wrong"), said.append)
    assert [case.tries for case in found.cases] == [3, 3]
    assert [case.failed for case in found.cases] == [True, False]
    assert found.skipped[0].fault == "missing"
    assert {each.name for each in (tmp_path / "wrong").iterdir()} == {
        f"{COVERED.name}-1",
        f"{COVERED.name}-2",
    }
    assert (tmp_path / "wrong" / f"{COVERED.name}-2" / "run.err").read_text(
        encoding="utf-8"
    ) == "what it said"
    assert len(said) == 6


def test_ctrl_c_leaves_the_tries_that_are_over(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken_off(fault: Fault, folder: Path, ros: int | None) -> Try:
        if folder.name.endswith("-2"):
            raise KeyboardInterrupt
        return attempted(fault, folder, ros)

    monkeypatch.setattr(session, "attempt", broken_off)
    found = tried([COVERED, UNCOVERED], Tries(5), lambda _: None)
    assert found.interrupted
    assert [case.tries for case in found.cases] == [2]
