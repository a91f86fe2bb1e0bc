"""What speaks against a long run."""

from __future__ import annotations

from typing import Any

import pytest

from hil.soak.memory import Sample
from hil.soak.verdict import as_result
from hil.soak.verified_log import Verification
from hil.soak.watched_run import WatchedRun

FLAT = [Sample(float(t), 100.0) for t in range(0, 3600, 5)]
GROWING = [Sample(float(t), 100.0 + 2.0 * t / 3600.0) for t in range(0, 3600, 5)]
CYCLES = {"count": 200_000, "late": 9, "limit_ms": 40.0, "longest_ms": 55.0}
PAIRS: dict[str, Any] = {
    "duration_s": 3600.0,
    "pairs": [
        {"cycles": CYCLES, "findings": [{"name": "clock"}]},
        {"cycles": {**CYCLES, "longest_ms": 60.0}},
    ],
}
WELL = Verification(0, 1000, 0)


def failures(
    summary: dict[str, Any] = PAIRS,
    code: int = 0,
    verified: Verification | None = WELL,
    recorder: list[Sample] = FLAT,
) -> list[str]:
    run = WatchedRun(code, summary, "abreast: it broke", {"recorder": recorder, "run": FLAT})
    told: list[str] = as_result("turtlebot3", run, verified)["failed"]
    return told


def test_all_followers_count_together() -> None:
    result = as_result("turtlebot3", WatchedRun(0, PAIRS, "", {"run": FLAT}), WELL)
    assert result["cycles"] == {"count": 400_000, "late": 18, "limit_ms": 40.0, "longest_ms": 60.0}
    assert result["findings"] == ["clock"]
    assert result["failed"] == []
    assert result["processes"][0]["growth_mb_h"] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"code": 1}, "the run ended with exit code 1: abreast: it broke"),
        ({"recorder": GROWING}, "recorder grows by 2.00 MB an hour, expected 1 at most"),
        ({"summary": {"cycles": {**CYCLES, "late": 21}}}, "21 of 200000 cycles were late"),
        ({"verified": Verification(1, 1000, 3)}, "3 of 1000 outputs differ"),
        ({"verified": Verification(2, 0, 0, "abreast: log: damaged")}, "exit code 2: abreast: log: damaged"),
        ({"summary": {"duration_s": 1.0}}, "no cycles to judge"),
        ({"verified": None}, "there is no log"),
    ],
)
def test_what_is_wrong_is_named(wrong: dict[str, Any], words: str) -> None:
    (told,) = failures(**wrong)
    assert words in told
