"""A folder of logs judged in one go: a row each, the same figures as one by one, and nothing lost."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from pyarrow import parquet

from hil.errors import UsageError
from hil.judge.replayed import ReplayChoice, replayed
from hil.log.opened import opened_log
from hil.sweep import judged_logs
from hil.sweep.judged_logs import judge_logs, write_judged
from hil.sweep.shared_work import LostWorkerError
from hil.sweep.worst_logs import worst_of
from tests.reference_logs import path_of

NAMES = ("plain-ekf", "rough-ukf")


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Two logs, one of which is in a folder, and one that is no log."""
    folder = tmp_path / "logs"
    (folder / "inner").mkdir(parents=True)
    shutil.copy(path_of(NAMES[0]), folder)
    shutil.copy(path_of(NAMES[1]), folder / "inner")
    (folder / "broken.mcap").write_bytes(b"rubbish")
    return folder


def judged(folder: Path, **options: Any) -> dict[str, Any]:
    return judge_logs(folder, ReplayChoice(), progress=lambda done, total: None, **options)


def without_times(result: dict[str, Any]) -> dict[str, Any]:
    rows = [{name: value for name, value in row.items() if name != "wall_s"} for row in result["logs"]]
    return {**result, "logs": rows, "wall_s": 0.0}


def test_each_row_is_what_its_log_alone_would_give(logs: Path, tmp_path: Path) -> None:
    result = judged(logs)
    rows = {row["log"]: row for row in result["logs"]}
    assert list(rows) == ["broken.mcap", "plain-ekf.mcap", "inner/rough-ukf.mcap"]
    assert "is not MCAP" in rows["broken.mcap"]["error"]
    assert (result["judged"], result["broken"], result["failed"]) == (2, 1, 0)
    alone = replayed(opened_log(logs / "plain-ekf.mcap"), ReplayChoice()).summary
    assert rows["plain-ekf.mcap"]["summary"] == alone
    write_judged(result, tmp_path)
    assert [row["log"] for row in json.loads((tmp_path / "results.json").read_text())["logs"]] == list(rows)
    table = {row["log"]: row for row in parquet.read_table(tmp_path / "results.parquet").to_pylist()}
    assert table["plain-ekf.mcap"]["estimation.rmse.v1"] == alone["estimation"]["rmse"]["v1"]
    assert table["broken.mcap"]["estimation.rmse.v1"] is None
    assert "is not MCAP" in table["broken.mcap"]["error"]


@pytest.mark.slow
def test_two_workers_give_what_one_gives(logs: Path) -> None:
    assert without_times(judged(logs)) == without_times(judged(logs, workers=2))


def test_checks_that_were_asked_for_are_told_by_log(logs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judged_logs, "violated_bounds", lambda summary: {"v1_extended": 3})
    result = judged(logs, strict=True)
    assert result["failed"] == 2
    assert all(row["failed"] == ["bounds violated: v1_extended"] for row in result["logs"] if "failed" in row)
    assert all("bounds violated" in worst["why"] for worst in result["worst"])


def test_results_of_before_are_left_out(logs: Path) -> None:
    assert [row["log"] for row in judged(logs, leave_out=logs / "inner")["logs"]] == [
        "broken.mcap",
        "plain-ekf.mcap",
    ]
    with pytest.raises(UsageError, match="holds no logs"):
        judged(logs, leave_out=logs)


def test_a_surprise_in_a_log_is_its_row_and_not_the_end(logs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def surprised(log: object, choice: object) -> None:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(judged_logs, "replayed", surprised)
    errors = [row["error"] for row in judged(logs)["logs"]]
    assert all("ZeroDivisionError: by nothing" in error for error in errors[1:])


@pytest.mark.parametrize(("error", "said"), [(KeyboardInterrupt, "broken off"), (LostWorkerError, "died")])
def test_what_was_judged_is_kept_when_the_rest_cannot_be(
    logs: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException], said: str
) -> None:
    def ending(task: Any, items: list[Path], workers: int) -> Any:
        yield items[1], task(items[1])
        raise error("a worker died")

    monkeypatch.setattr(judged_logs, "shared_here", ending)
    result = judged(logs)
    assert ["summary" in row for row in result["logs"]] == [False, True, False]
    assert said in result["logs"][2]["error"]
    assert bool(result.get("interrupted")) == (error is KeyboardInterrupt)


def row(name: str, v1: float, **others: Any) -> dict[str, Any]:
    return {"log": name, "summary": {"estimation": {"rmse": {"v1": v1}, "untracked": 0}}, **others}


def test_the_worst_are_named_with_why() -> None:
    rows = [row(f"{n}", 1.0) for n in range(8)]
    rows += [row("high", 4.0), row("failed", 1.0, failed=["log damaged"]), {"log": "broken", "error": "x"}]
    worst = worst_of(rows)
    assert [each["log"] for each in worst[:2]] == ["failed", "high"]
    assert worst[0]["why"].startswith("log damaged")
    assert worst[1]["why"] == "RMSE of v1 4.00 times the median of all logs"
    assert len(worst) == 3, "what does not stand out is not named, but for the first few"
    pairs = {"pairs": [{"follower": f"robot{n}", "estimation": {"rmse": {"v1": 1.0 * n}}} for n in (1, 9)]}
    assert worst_of([*rows, {"log": "chain", "summary": pairs}])[1]["log"] == "chain", "by its worst pair"
