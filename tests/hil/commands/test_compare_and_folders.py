"""``compare``, and ``replay`` of a folder of logs, as a user types them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from hil.command_line import main
from hil.commands import replay_folder
from hil.lockstep.run import run_lockstep
from hil.scenario.files import load_scenario
from tests.reference_logs import SHORT, path_of


def abreast(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code of the console script, and what it said on stdout and stderr."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    caught = capsys.readouterr()
    assert isinstance(left.value.code, int)
    return left.value.code, caught.out, caught.err


PLAIN, ROUGH = path_of("plain-ekf"), path_of("rough-ukf")


def test_two_logs_are_compared_as_they_were_recorded(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, out, _ = abreast(capsys, "compare", PLAIN, ROUGH, "--json", "--out", tmp_path / "out")
    assert code == 0
    told: dict[str, Any] = json.loads(out)
    assert told["verdict"]["best"] == "plain-ekf.mcap"
    assert told["differences"]["estimator.kind"] == [["ekf"], ["ukf"]]
    assert told["differences"]["run.seed"] == [["1"], ["7"]]
    assert told["metrics"]["estimation.rmse.v1"]["better"] == "lower"
    assert json.loads((tmp_path / "out" / "compare.json").read_text()) == told
    page = (tmp_path / "out" / "compare.html").read_text()
    assert "Error of v₁" in page
    assert "Commanded turn rate" in page
    _, out, _ = abreast(capsys, "compare", PLAIN, ROUGH)
    assert out.startswith("plain-ekf.mcap was better than rough-ukf.mcap: ")


def test_a_regression_is_exit_code_1_and_named(capsys: pytest.CaptureFixture[str]) -> None:
    condition = "estimation.rmse.v1 > 1.1"
    code, out, err = abreast(capsys, "compare", PLAIN, ROUGH, "--fail-if", condition)
    assert code == 1
    assert "RMSE of v1" in out, "what there is to say is said all the same"
    assert "rough-ukf.mcap: estimation.rmse.v1 is" in err
    assert abreast(capsys, "compare", ROUGH, PLAIN, "--fail-if", condition)[0] == 0
    code, _, err = abreast(capsys, "compare", PLAIN, ROUGH, "--fail-if", "estimation.rmse.v > 1")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "the nearest is estimation.rmse.v1" in err
    assert abreast(capsys, "compare", PLAIN)[0] == 2


def test_a_replay_is_compared_by_the_estimates_that_it_made(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for estimator in ("ekf", "difference"):
        done = abreast(capsys, "replay", PLAIN, "--estimator", estimator, "--out", tmp_path / estimator)
        assert done[0] == 0
    folders = (tmp_path / "ekf", tmp_path / "difference")
    code, out, _ = abreast(capsys, "compare", *folders, "--json", "--out", tmp_path / "out")
    told = json.loads(out)
    assert code == 0
    assert told["differences"] == {"estimator.kind": [["ekf"], ["difference"]]}
    metric = told["metrics"]["estimation.rmse.v1"]
    assert metric["groups"][0]["median"] < metric["groups"][1]["median"]


def test_a_folder_of_logs_is_judged_to_its_end(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    for n, log in enumerate((PLAIN, ROUGH, PLAIN)):
        shutil.copy(log, logs / f"run_{n}.mcap")
    code, out, _ = abreast(capsys, "replay", logs, "--workers", "1", "--json")
    told = json.loads(out)
    assert code == 0
    assert (told["judged"], told["broken"]) == (3, 0)
    assert told["worst"][0]["log"] == "run_1.mcap"
    page = (tmp_path / "logs-out" / "report.html").read_text()
    assert 'href="./worst-1/report.html"' in page
    assert (tmp_path / "logs-out" / "worst-1" / "report.html").is_file()
    assert 'href="../logs/run_1.mcap"' in page
    (logs / "broken.mcap").write_bytes(b"rubbish")
    code, out, err = abreast(capsys, "replay", logs, "--workers", "1", "--out", tmp_path / "again")
    assert code == 1
    assert "3 of 4 logs judged, 1 could not be" in out
    assert "is not MCAP" in err.splitlines()[-1]
    assert (tmp_path / "again" / "results.parquet").is_file()
    code, out, _ = abreast(capsys, "compare", tmp_path / "logs-out", tmp_path / "again", "--json")
    assert json.loads(out)["verdict"].get("best") is None, "what is the same is alike"


def test_a_chain_among_the_worst_has_a_page_of_all_its_followers(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    shutil.copy(PLAIN, logs / "pair.mcap")
    run_lockstep(load_scenario("chain5-turtlebot3", (*SHORT, "mocap.sigma_position=0.01")), logs / "row.mcap")
    code, out, _ = abreast(capsys, "replay", logs, "--workers", "1", "--json")
    assert code == 0
    row = next(each for each in json.loads(out)["logs"] if each["log"] == "row.mcap")
    page = (tmp_path / "logs-out" / row["report"]).read_text()
    assert "What each follower did" in page
    summary = json.loads((tmp_path / "logs-out" / row["report"]).with_name("summary.json").read_text())
    assert [pair["follower"] for pair in summary["pairs"]] == [
        pair["follower"] for pair in row["summary"]["pairs"]
    ]


def test_figures_of_a_folder_of_logs_are_refused_with_their_reason(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.mcap").write_bytes(b"")
    code, _, said = abreast(capsys, "replay", tmp_path, "--figures", "pdf")
    assert code == 2
    assert "--figures: is for a single log" in said


def test_what_is_for_one_log_or_for_many_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_folder, "made_folder", lambda folder: pytest.fail("nothing is begun"))
    logs = tmp_path / "logs"
    logs.mkdir()
    for n in range(2):
        shutil.copy(PLAIN, logs / f"run_{n}.mcap")
    for arguments, said in (
        ((logs, "--csv", tmp_path / "table.csv"), "--csv: is for a single log"),
        ((logs, "--propose-map"), "--propose-map: is for a single log"),
        ((PLAIN, "--workers", "2"), "is a single log"),
    ):
        code, _, err = abreast(capsys, "replay", *arguments)
        assert (code, len(err.splitlines())) == (2, 1)
        assert said in err
