from __future__ import annotations

import os
from pathlib import Path

import pytest

from hil.errors import AbreastError, UsageError
from hil.log.disk import disk_of
from hil.log.report_json import write_json
from hil.log.written_aside import write_text_aside, written_aside
from tests.hil.small_disk import small_disk


def test_what_was_written_takes_its_place_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    path.write_text("before")
    with written_aside(path) as aside:
        aside.write_text("after")
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert list(tmp_path.iterdir()) == [path]


def test_what_breaks_off_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    path.write_text("before")

    def broken() -> None:
        with written_aside(path) as aside:
            aside.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_one_and_a_device_is_written_to(tmp_path: Path) -> None:
    target, link = tmp_path / "there.json", tmp_path / "here.json"
    target.write_text("before")
    link.symlink_to(target)
    write_text_aside(link, "after")
    assert link.is_symlink()
    assert target.read_text() == "after"
    write_text_aside(Path(os.devnull), "nothing")
    assert not Path(os.devnull).is_file()


def test_a_full_device_is_named_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "summary.json").symlink_to("/dev/full")
    with pytest.raises(AbreastError, match=r"summary.json: writing failed .No space left.* on disk /"):
        write_json({"a": 1}, tmp_path / "summary.json")


def test_a_folder_that_is_missing_is_told_by_the_name_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "summary.json"
    with pytest.raises(FileNotFoundError) as refused:
        write_json({}, path)
    assert refused.value.filename == str(path)


def test_a_full_disk_keeps_whole_files_and_is_named(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1) as folder:
        assert disk_of(folder / "x" / "y.json") == f"disk {folder} (1.0 MB free)"
        write_text_aside(folder / "report.html", "whole")
        with pytest.raises(AbreastError, match=f"report.html: writing failed .* on disk {folder}") as refused:
            write_text_aside(folder / "report.html", "x" * 2_000_000)
        assert not isinstance(refused.value, UsageError)
        assert (folder / "report.html").read_text() == "whole"
        assert [each.name for each in folder.iterdir()] == ["report.html"]
