from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.recordings.mrclam_folder import read_pair, read_series

TRACK = (
    "# Time [s] x [m] y [m] orientation [rad]\n1248444200.253 \t 1.5 \t -3.25 \t 0.5\n1248444200.270 1 2 3\n"
)
ODOMETRY = "# Time v u\n1248444200.200 0.067 -0.014\n1248444200.300 0.086 0\n"


def folder(path: Path, **replaced: str) -> Path:
    for robot in (1, 2, 4):
        for kind, text in (("Groundtruth", TRACK), ("Odometry", ODOMETRY)):
            name = f"Robot{robot}_{kind}"
            (path / f"{name}.dat").write_text(replaced.get(name, text))
    return path


def test_both_tracks_and_the_odometry_of_the_follower_are_read(tmp_path: Path) -> None:
    other = ODOMETRY.replace("0.086", "0.01")
    pair = read_pair(folder(tmp_path, Robot4_Odometry=other), 2, 4)
    assert (pair.leader, pair.follower) == ("robot2", "robot4")
    assert pair.leader_track.stamps_ns.tolist() == [1248444200_253000000, 1248444200_270000000]
    assert pair.leader_track.values.tolist() == [[1.5, -3.25, 0.5], [1.0, 2.0, 3.0]]
    assert pair.odometry.values.tolist() == [[0.067, -0.014], [0.01, 0.0]]


def test_of_rows_with_one_stamp_the_last_counts(tmp_path: Path) -> None:
    path = tmp_path / "rows.dat"
    path.write_text("1 0.1 0.2\n2 0.3 0.4\n2 0.5 0.6\n")
    found = read_series(path, 2)
    assert found.stamps_ns.tolist() == [1_000_000_000, 2_000_000_000]
    assert found.values.tolist() == [[0.1, 0.2], [0.5, 0.6]]


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ((2, 2), r"--leader 2 --follower 2: expected two different robots"),
        ((7, 1), r"--leader 7: folder .* has no such robot; there are: 1, 2, 4"),
        ((1, 3), r"--follower 3: folder .* has no such robot; there are: 1, 2, 4"),
    ],
)
def test_robots_that_make_no_pair_are_named(pair: tuple[int, int], message: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=message):
        read_pair(folder(tmp_path), *pair)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("Robot1_Groundtruth", "# x\n1 2 3\n", r"Robot1_Groundtruth\.dat: line 2 has 3 numbers, expected 4"),
        ("Robot1_Groundtruth", "1 2 three 4\n", r"line 1: 'three', expected a number"),
        ("Robot2_Groundtruth", "1 2 nan 4\n", r"line 1: nan, expected a finite number"),
        ("Robot2_Odometry", "2 0 0\n1 0 0\n", r"Robot2_Odometry\.dat: line 2: time 1 s runs backwards"),
        ("Robot2_Odometry", "# nothing\n", r"has no rows; expected a time and 2 numbers in each"),
        ("Robot2_Odometry", "-1 0 0\n", r"line 1: time -1 s, expected 0 or later"),
        (
            "Robot1_Groundtruth",
            "1 2 3 4\n",
            r"have no time in common \(1\.000 to 1\.000 s and 1248444200\.253",
        ),
    ],
)
def test_a_file_that_is_wrong_is_answered_with_its_line(
    file: str, text: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=message):
        read_pair(folder(tmp_path, **{file: text}), 1, 2)


def test_a_folder_that_is_none_or_has_no_tracks_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such folder; check the path"):
        read_pair(tmp_path / "none", 1, 2)
    with pytest.raises(UsageError, match=r"no RobotN_Groundtruth\.dat in it"):
        read_pair(tmp_path, 1, 2)
    folder(tmp_path)
    (tmp_path / "Robot2_Odometry.dat").unlink()
    with pytest.raises(UsageError, match=r"Robot2_Odometry\.dat: no such file"):
        read_pair(tmp_path, 1, 2)
    (tmp_path / "Robot2_Odometry.dat").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match=r"is not text"):
        read_pair(tmp_path, 1, 2)
