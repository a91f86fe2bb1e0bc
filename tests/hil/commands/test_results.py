"""Results go to stdout, progress and notes to stderr, and one JSON object is alone on stdout."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hil.command_line import main
from hil.log.reader import Log


class Said:
    """What a command printed and how it ended."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *arguments: object) -> None:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        self.code, (self.out, self.err) = left.value.code, capsys.readouterr()


CASES = {
    "run": (["run", "--lockstep", "--duration", "1", "--out", "{out}"], "RMSE v1"),
    "chain": (["run", "chain5-turtlebot3", "--lockstep", "--duration", "1", "--out", "{out}"], "follower"),
    "replay": (["replay", "{log}", "--verify", "--out", "{out}"], "RMSE v1"),
    "simulate": (["simulate", "fig2-independent", "--duration", "1"], "rho"),
    "gains": (["gains"], "mu1"),
    "bounds": (["bounds"], "alpha1"),
    "recover": (["recover", "{log}", "--out", "{out}.mcap"], "lacks nothing"),
    "calibrate": (["calibrate", "{log}"], "transport_s"),
    "sweep": (
        [
            "sweep",
            "--runs",
            "1",
            "--duration",
            "5",
            "--estimators",
            "ekf",
            "--workers",
            "1",
            "--out",
            "{out}",
        ],
        "report.html",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_on_stdout_and_json_is_alone_there(
    name: str, short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, told = CASES[name]
    for number, options in enumerate(([], ["--json"])):
        said = Said(
            capsys, *(each.format(log=short_log.path, out=tmp_path / str(number)) for each in words), *options
        )
        assert said.code == 0, said.err
        if options:
            assert isinstance(json.loads(said.out), dict)
            assert said.out.count("\n") == 1
        else:
            assert told in said.out
            assert told not in said.err


def test_what_a_person_reads_is_beside_the_json_on_stderr(
    short_log: Log, capsys: pytest.CaptureFixture[str]
) -> None:
    said = Said(capsys, "replay", short_log.path, "--json")
    assert "RMSE v1" in said.err


def test_lines_of_a_file_are_not_folded(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    whole = Said(capsys, "bounds").out
    monkeypatch.setenv("COLUMNS", "60")
    folded = Said(capsys, "bounds").out
    assert max(map(len, folded.splitlines()[:5])) <= 60
    assert len(whole.splitlines()) < len(folded.splitlines())
    assert not [line for line in whole.splitlines() if line.endswith(" ")]
