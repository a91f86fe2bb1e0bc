from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.live.runs_here import RunHere, found_here, runs_here, runtime_folder
from hil.wire.role_keys import RoleKeys
from hil.wire.roles import OPERATOR
from hil.wire.session import Endpoints

OPEN = Endpoints(connect="tcp/127.0.0.1:42077")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "abreast"


def test_a_run_is_found_while_it_goes_on(folder: Path) -> None:
    assert runs_here(folder) == []
    with found_here(OPEN, Path("one/scenario.toml"), folder), found_here(OPEN, Path("two"), folder):
        first, second = runs_here(folder)
        assert (first.endpoint, first.pid) == (OPEN.connect, os.getpid())
        assert first.scenario == str(Path.cwd() / "one" / "scenario.toml")
        assert second.options == "--connect tcp/127.0.0.1:42077"
        assert folder.stat().st_mode & 0o777 == 0o700
    assert runs_here(folder) == []
    assert list(folder.iterdir()) == []


def test_a_run_that_ends_badly_is_found_no_more(folder: Path) -> None:
    with pytest.raises(RuntimeError), found_here(OPEN, Path("s"), folder):
        raise RuntimeError
    assert runs_here(folder) == []


def test_a_run_that_was_killed_is_found_no_more_and_leaves_nothing(folder: Path) -> None:
    words = (
        "import os, signal; from pathlib import Path; from hil.live.runs_here import found_here; "
        "from hil.wire.session import Endpoints\n"
        f"with found_here(Endpoints(connect='tcp/127.0.0.1:1'), Path('s'), Path({str(folder)!r})):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", words], check=False).returncode == -9
    assert len(list(folder.iterdir())) == 1
    assert runs_here(folder) == []
    assert list(folder.iterdir()) == []


def test_a_config_file_is_named_by_its_whole_path(folder: Path) -> None:
    with found_here(Endpoints(config_file=Path("lab.json5")), Path("s"), folder):
        (run,) = runs_here(folder)
    assert run.options == f"--zenoh-config {Path.cwd() / 'lab.json5'}"


def test_nothing_of_keys_is_told_but_that_there_are_some(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RoleKeys, "check", lambda _: None)
    keyed = Endpoints(connect="tls/127.0.0.1:42077", keys=RoleKeys(Path("hidden/keys"), OPERATOR))
    with found_here(keyed, Path("s"), folder):
        (run,) = runs_here(folder)
        (file,) = folder.iterdir()
        assert "hidden" not in file.read_text(encoding="utf-8")
    assert run.has_keys
    assert run.options == "--connect tls/127.0.0.1:42077 --secure DIR"


def test_a_folder_that_others_may_write_to_is_neither_believed_nor_used(tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    with found_here(OPEN, Path("s"), theirs):
        theirs.chmod(0o777)
        assert runs_here(theirs) == []
        with found_here(OPEN, Path("t"), theirs):
            assert len(list(theirs.iterdir())) == 1
        (tmp_path / "link").symlink_to(theirs)
        theirs.chmod(0o700)
        assert len(runs_here(theirs)) == 1
        assert runs_here(tmp_path / "link") == []


def test_where_no_file_can_be_a_run_goes_on_without(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with found_here(OPEN, Path("s"), tmp_path / "file"):
        assert runs_here(tmp_path / "file") == []


@pytest.mark.parametrize("text", ["", "{", "[]", '{"endpoint": 5}', '{"endpoint": "?", "zenoh_config": ""}'])
def test_a_file_that_tells_of_no_run_is_left(folder: Path, text: str) -> None:
    with found_here(OPEN, Path("s"), folder):
        (file,) = folder.iterdir()
        # What is written in place keeps the lock.
        file.write_text(text, encoding="utf-8")
        assert runs_here(folder) == []


def test_the_folder_is_of_the_user(tmp_path: Path) -> None:
    assert runtime_folder({"XDG_RUNTIME_DIR": str(tmp_path)}, 7) == tmp_path / "abreast"
    for absent in ({}, {"XDG_RUNTIME_DIR": str(tmp_path / "none")}):
        assert runtime_folder(absent, 987_654).name == "abreast-987654"
    assert not RunHere("tcp/h:1", "", 1, 0.0, "s").has_keys
