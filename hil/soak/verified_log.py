"""The log of a long run, replayed in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Verification:
    """How a replay of a log went: its exit code, outputs compared and that differ, and what it said last."""

    code: int
    compared: int
    differ: int
    said: str = ""


def verified_log(log: Path) -> Verification | None:
    """Replay a log and compare; None where there is none."""
    if not log.exists():
        return None
    command = [sys.executable, "-m", "hil", "replay", str(log), "--verify", "--json"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    summary: dict[str, Any] = json.loads(done.stdout) if done.stdout.strip() else {}
    counts = summary.get("parity", {}).values()
    return Verification(
        done.returncode,
        sum(each["compared"] for each in counts),
        sum(each["mismatched"] for each in counts),
        (done.stderr.strip().splitlines() or [""])[-1],
    )
