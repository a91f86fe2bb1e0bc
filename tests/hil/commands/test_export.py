"""``abreast export`` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from hil.command_line import main
from hil.exports import table_file
from hil.log.reader import Log


def said(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int | str | None, str, str]:
    capsys.readouterr()
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in ("export", *arguments)])
    caught = capsys.readouterr()
    return left.value.code, caught.out, caught.err


def test_it_says_on_stdout_what_it_wrote(
    short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said(capsys, short_log.path, "--to", tmp_path / "out")
    assert (code, err) == (0, "")
    paths = [Path(line.partition(": ")[0]) for line in out.splitlines()]
    assert tmp_path / "out/aligned.parquet" in paths
    assert all(pl.read_parquet(path).height for path in paths)
    code, out, err = said(capsys, short_log.path, "--to", tmp_path / "out")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--overwrite" in err
    code, out, err = said(capsys, short_log.path, "--to", tmp_path / "out", "--overwrite", "--json")
    assert code == 0
    assert json.loads(out)["aligned"] == str(tmp_path / "out/aligned.parquet")
    assert err == ""
    code, out, err = said(capsys, short_log.path, "--to", tmp_path / "out", "--overwrite", "--format", "csv")
    assert code == 0
    assert "still there from an export before" in err
    assert str(tmp_path / "out/topics/truth.parquet") in err


def test_without_pyarrow_tables_are_csv(
    short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_file, "has_parquet", lambda: False)
    code, out, err = said(capsys, short_log.path, "--to", tmp_path / "out")
    assert code == 0
    assert "abreast[tables]" in err
    assert (tmp_path / "out/aligned.csv").is_file()
    assert "aligned.csv" in out


def test_a_damaged_log_leaves_what_is_whole_and_exits_with_1(
    short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = bytearray(short_log.path.read_bytes())
    middle = short_log.chunks[len(short_log.chunks) // 2].offset + 100
    torn[middle : middle + 40] = bytes(40)
    (tmp_path / "torn.mcap").write_bytes(torn)
    code, _, err = said(capsys, tmp_path / "torn.mcap", "--to", tmp_path / "out")
    assert code == 1
    assert "damaged" in err.splitlines()[-1]
    assert (tmp_path / "out/aligned.parquet").is_file()


def test_layouts_alone_need_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = said(capsys, "--layouts", tmp_path / "layouts")
    assert code == 0
    assert [Path(line).name for line in out.splitlines()] == ["foxglove.json", "plotjuggler.xml"]
    assert all(Path(line).is_file() for line in out.splitlines())
    code, out, err = said(capsys)
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_a_file_for_viewers_is_not_written_over(
    short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = (short_log.path, "--to", tmp_path / "out", "--format", "foxglove")
    code, out, err = said(capsys, *arguments)
    assert (code, err) == (0, "")
    assert out.startswith(f"{tmp_path / 'out/foxglove.mcap'}: ")
    code, _, err = said(capsys, *arguments)
    assert code == 2
    assert "--overwrite" in err
    code, out, _ = said(capsys, *arguments, "--overwrite", "--json")
    assert json.loads(out)["messages"]["/truth"] == short_log.counts["truth"]


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("columns.csv", ["--format", "csv"]),
        ("foxglove.json", ["--format", "foxglove"]),
        ("plotjuggler.xml", ["--format", "foxglove"]),
    ],
)
def test_nothing_in_the_folder_is_written_over_unasked(
    short_log: Log,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    arguments: list[str],
) -> None:
    (tmp_path / name).write_text("of mine")
    code, out, err = said(capsys, short_log.path, "--to", tmp_path, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert name in err
    assert [each.name for each in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "of mine"


def test_layouts_are_not_written_over_unasked(
    short_log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = tmp_path / "plotjuggler.xml"
    layout.write_text("of mine")
    for arguments in ([], [short_log.path, "--to", tmp_path / "out"]):
        code, out, err = said(capsys, *arguments, "--layouts", tmp_path)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert layout.read_text() == "of mine"
    assert not (tmp_path / "out").exists()
    code, _, _ = said(capsys, "--layouts", tmp_path, "--overwrite")
    assert code == 0
    assert layout.read_text() != "of mine"
    both = tmp_path / "both"
    code, _, err = said(capsys, short_log.path, "--to", both, "--format", "foxglove", "--layouts", both)
    assert (code, err) == (0, "")
