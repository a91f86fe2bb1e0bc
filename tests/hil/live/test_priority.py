"""Stepping aside for a run, seen from the process that does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

_ASIDE = "import os; from hil.live.priority import step_aside; step_aside({}); print(os.nice(0), {})"
_GROUP = "open('/proc/self/autogroup').read()"


def aside(niceness: int, *, leads: bool, then: str = "''") -> list[str]:
    """What a process says of itself that stepped aside; ``leads``: a session of its own."""
    words = [sys.executable, "-c", _ASIDE.format(niceness, then)]
    told = subprocess.run(
        words, capture_output=True, text=True, check=True, start_new_session=leads, timeout=60
    )
    return told.stdout.split()


@pytest.mark.parametrize("leads", [False, True])
@pytest.mark.parametrize("niceness", [0, 5, 30])
def test_a_process_steps_aside_by_so_much(niceness: int, *, leads: bool) -> None:
    assert int(aside(niceness, leads=leads)[0]) == min(niceness, 19)


def test_a_session_of_its_own_steps_aside_as_a_whole() -> None:
    if not Path("/proc/self/autogroup").exists():
        assert aside(5, leads=True) == ["5"], "a kernel that knows no such groups is no reason to fail"
        return
    assert aside(5, leads=True, then=_GROUP)[-1] == "5"
    ours = Path("/proc/self/autogroup").read_text().split()
    assert aside(5, leads=False, then=_GROUP)[1:] == ours, "who started us goes on as before"
