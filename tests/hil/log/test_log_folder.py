"""What in a folder is a log by itself, and what is one log in pieces."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from hil.log.log_folder import is_folder_of_logs, logs_in
from hil.log.writer import LogWriter
from hil.wire.message_types import String
from hil.wire.messages import encode, typename_of
from tests.reference_logs import path_of

SECOND_NS = 1_000_000_000


def strangers(path: Path, begin_s: int, end_s: int) -> Path:
    """A log that does not come from abreast, with a message at its begin and one at its end."""
    with LogWriter(path, {}) as log:
        for at_s in (begin_s, end_s):
            at_ns = at_s * SECOND_NS
            log.write("/text", typename_of(String), encode(String(data="x")), at_ns, at_ns)
    return path


def ours(path: Path, name: str = "plain-ekf") -> Path:
    shutil.copy(path_of(name), path)
    return path


def test_runs_of_ours_are_logs_each_however_they_are_called(tmp_path: Path) -> None:
    logs = [ours(tmp_path / f"run_{n}.mcap") for n in (1, 2, 10)]
    assert logs_in(tmp_path) == logs, "in the order of their numbers"
    assert is_folder_of_logs(tmp_path)


def test_logs_in_folders_are_found(tmp_path: Path) -> None:
    for name in ("b", "a", ".hidden"):
        (tmp_path / name).mkdir()
        ours(tmp_path / name / "run.mcap")
    (tmp_path / "summary.json").write_text("{}")
    assert logs_in(tmp_path) == [tmp_path / "a" / "run.mcap", tmp_path / "b" / "run.mcap"]


def test_a_bag_in_it_is_one_log(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    for n in range(2):
        strangers(bag / f"part{n}.mcap", 100 * n, 100 * n + 1)
    assert logs_in(bag) == [bag]
    assert not is_folder_of_logs(bag)
    alone = ours(tmp_path / "run.mcap")
    assert logs_in(tmp_path) == [alone, bag]


@pytest.mark.parametrize("folder", ["run", "other"])
def test_numbered_files_of_a_stranger_are_one_log(tmp_path: Path, folder: str) -> None:
    inside = tmp_path / folder
    inside.mkdir()
    for n in range(3):
        strangers(inside / f"run_{n}.mcap", 100 * n, 100 * n + 1)
    assert logs_in(inside) == [inside]


def test_a_strangers_recordings_of_other_days_are_logs_each(tmp_path: Path) -> None:
    logs = [strangers(tmp_path / "monday.mcap", 0, 9), strangers(tmp_path / "tuesday.mcap", 86_400, 86_409)]
    assert logs_in(tmp_path) == logs
    (tmp_path / "at_once").mkdir()
    for name in ("mocap", "robot"):
        strangers(tmp_path / "at_once" / f"{name}.mcap", 0, 9)
    assert logs_in(tmp_path / "at_once") == [tmp_path / "at_once"]


def test_what_is_broken_is_a_log_too(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"rubbish")
    assert logs_in(tmp_path) == [tmp_path / "a.mcap"]
    whole = ours(tmp_path / "b.mcap")
    assert logs_in(tmp_path) == [tmp_path / "a.mcap", whole]


def test_a_file_and_a_folder_with_a_single_one_are_no_folders_of_logs(tmp_path: Path) -> None:
    log = ours(tmp_path / "run.mcap")
    assert not is_folder_of_logs(log)
    assert not is_folder_of_logs(tmp_path)
    (tmp_path / "empty").mkdir()
    assert not is_folder_of_logs(tmp_path / "empty")


def test_a_link_to_what_is_found_anyway_is_no_second_log(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "runs", tmp_path / "elsewhere"
    for each in (folder / "run_3", folder / "zone", elsewhere / "far"):
        each.mkdir(parents=True)
    runs = [ours(each / "run.mcap") for each in (folder, folder / "run_3")]
    ours(elsewhere / "far" / "run.mcap")
    (folder / "latest").symlink_to("run_3")
    (folder / "latest.mcap").symlink_to(folder / "run_3" / "run.mcap")
    (folder / "zone" / "top").symlink_to(folder)
    (folder / "zone" / "up").symlink_to(tmp_path)
    (folder / "far").symlink_to(elsewhere / "far")
    (folder / "far_too").symlink_to(elsewhere / "far")
    assert logs_in(folder) == [runs[0], folder / "far" / "run.mcap", runs[1]]
    assert logs_in(folder / "latest") == [folder / "latest" / "run.mcap"], "asked for by the link itself"


def test_a_link_to_a_piece_makes_pieces_no_logs_of_their_own(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    for n in range(2):
        strangers(bag / f"bag_{n}.mcap", 100 * n, 100 * n + 1)
    (bag / "newest.mcap").symlink_to("bag_1.mcap")
    (tmp_path / "newest.mcap").symlink_to(bag / "bag_1.mcap")
    assert logs_in(tmp_path) == [bag]
