"""``abreast import`` as a user types it: what it says of a recording, and what comes of it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formation.angles import wrap
from formation.pose import Pose
from formation.shape import shape_of
from hil.command_line import main
from hil.lockstep.run import run_lockstep
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import Truth
from hil.wire.messages import decode_as, to_ns
from tests.recording_layouts import (
    ROWS,
    Motive,
    Qtm,
    Table,
    Tracks,
    motive_text,
    qtm_text,
    table_text,
    tracks,
    tum_text,
)


def pair_of_robots(*, gaps: bool = False) -> Tracks:
    return tracks(5, planar=False, gaps=gaps)


class Said(NamedTuple):
    code: int
    out: str
    err: str


class Abreast(Protocol):
    def __call__(self, *arguments: object) -> Said: ...


@pytest.fixture
def abreast(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Abreast:
    """Call the console script in a folder of its own: exit code and what it said."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> Said:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main(["import", *(str(argument) for argument in arguments)])
        caught = capsys.readouterr()
        assert isinstance(left.value.code, int)
        return Said(left.value.code, caught.out, caught.err)

    return call


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> list[Truth]:
    path = tmp_path_factory.mktemp("driven") / "run.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=6"]), path)
    return [decode_as(record.payload, Truth) for record in read_log(path).records([topics.TRUTH])][: 6 * 120]


def seen(driven: list[Truth]) -> Tracks:
    """True states with a motion capture's noise, time from 0."""
    draw = np.random.default_rng(7)
    begin_ns = to_ns(driven[0].header.stamp)
    poses = []
    for role in ("leader", "follower"):
        x, y, theta = (
            np.array([getattr(each, f"{role}_{name}") for each in driven]) for name in ("x", "y", "theta")
        )
        x, y = (values + draw.normal(0.0, 0.0003, len(driven)) for values in (x, y))
        theta = theta + draw.normal(0.0, 0.0035, len(driven))
        turned = Rotation.from_euler("z", theta[:, None]).as_quat()
        poses.append(np.column_stack([x, y, np.full(len(driven), 0.1), turned]))
    t_ns = [to_ns(each.header.stamp) - begin_ns for each in driven]
    return Tracks(t_ns, poses[0], poses[1], np.zeros((len(driven), 2)))


def errors(log: Path, driven: list[Truth]) -> tuple[float, float]:
    """RMSE of v1 [m/s] and alpha1 [rad] of the estimates from 2 s on."""
    begin_ns = to_ns(driven[0].header.stamp)
    by_time = {to_ns(each.header.stamp) - begin_ns: each for each in driven}
    v1, alpha1 = [], []
    for estimate in replay(read_log(log)).estimates:
        true = by_time[to_ns(estimate.header.stamp)]
        if to_ns(estimate.header.stamp) < 2_000_000_000:
            continue
        shape = shape_of(
            Pose(true.leader_x, true.leader_y, true.leader_theta),
            Pose(true.follower_x, true.follower_y, true.follower_theta),
        )
        v1.append(estimate.v1 - true.v1)
        alpha1.append(float(wrap(estimate.alpha1 - shape.alpha1)))
    assert len(v1) > 400
    return float(np.sqrt(np.mean(np.square(v1)))), float(np.sqrt(np.mean(np.square(alpha1))))


@pytest.mark.parametrize("kind", ["motive", "qtm", "tum", "table"])
def test_a_recording_goes_through_in_one_command(
    kind: str, abreast: Abreast, driven: list[Truth], tmp_path: Path
) -> None:
    pair = seen(driven)
    if kind == "tum":
        for name, poses in (("leader", pair.leader), ("follower", pair.follower)):
            (tmp_path / f"{name}.txt").write_bytes(tum_text(pair.t_ns, poses, comments=True))
        said = abreast("tum", "leader.txt", "follower.txt", "--out", "take.mcap")
    else:
        text = {
            "motive": lambda: motive_text(Motive(version="1.25", unit="Millimeters", markers=True), pair),
            "qtm": lambda: qtm_text(Qtm(), pair),
            "table": lambda: table_text(Table(odometry=0, delimiter=";", decimal=","), pair),
        }[kind]()
        (tmp_path / "take.csv").write_bytes(text)
        said = abreast("csv", "take.csv")
    assert said.code == 0
    assert "120 Hz" in said.out
    assert "take.mcap: 720 rows from 0 s to 5.99167 s; go on with: abreast replay take.mcap" in said.out
    found = errors(tmp_path / "take.mcap", driven)
    assert found[0] < 0.0015
    assert found[1] < 0.03


def written(folder: Path, text: bytes, name: str = "take.csv") -> Path:
    (folder / name).write_bytes(text)
    return folder / name


def test_gaps_are_counted_and_are_no_damage(abreast: Abreast, tmp_path: Path) -> None:
    written(tmp_path, motive_text(Motive(), pair_of_robots(gaps=True)))
    said = abreast("csv", "take.csv")
    assert said.code == 0
    assert f"take.csv: leader missing in 3 of {ROWS} rows" in said.out
    assert f"take.csv: follower missing in 1 of {ROWS} rows" in said.out


def test_bodies_are_named_where_there_are_more_than_two(abreast: Abreast, tmp_path: Path) -> None:
    pair = pair_of_robots()
    written(tmp_path, motive_text(Motive(strangers=2, names=("A", "B")), pair))
    said = abreast("csv", "take.csv")
    assert said.code == 2
    assert "name a pair by --leader NAME --follower NAME; there are: 'A', 'Box 0', 'Box 1', 'B'" in said.err
    assert said.err.count("\n") == 1
    assert not (tmp_path / "take.mcap").exists()
    said = abreast("csv", "take.csv", "--leader", "A", "--follower", "C")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert "--follower 'C': no such body" in said.err
    said = abreast("csv", "take.csv", "--leader", "A", "--follower", "A")
    assert "'A' cannot be both leader and follower" in said.err
    said = abreast("csv", "take.csv", "--leader", "B", "--follower", "A")
    assert said.code == 0
    assert "leader 'B', follower 'A' of 4 bodies" in said.out
    source = read_log(tmp_path / "take.mcap").metadata["source"]
    assert (source["leader"], source["follower"]) == ("B", "A")
    assert source["capture start time"] == "2026-01-05 03.49.50.755 PM"


def test_one_of_two_bodies_names_the_other(abreast: Abreast, tmp_path: Path) -> None:
    written(tmp_path, motive_text(Motive(names=("A", "B")), pair_of_robots()))
    assert "leader 'A', follower 'B'" in abreast("csv", "take.csv", "--out", "1.mcap").out
    assert "leader 'B', follower 'A'" in abreast("csv", "take.csv", "--leader", "B", "--out", "2.mcap").out
    assert "leader 'B', follower 'A'" in abreast("csv", "take.csv", "--follower", "A", "--out", "3.mcap").out


@pytest.mark.parametrize("kind", ["motive", "qtm", "table"])
def test_a_torn_end_is_said_and_the_rest_is_written(kind: str, abreast: Abreast, tmp_path: Path) -> None:
    pair = pair_of_robots()
    text = {
        "motive": motive_text(Motive(), pair),
        "qtm": qtm_text(Qtm(tab=False), pair),
        "table": table_text(Table(odometry=0), pair),
    }[kind]
    lines = text.count(b"\n")
    written(tmp_path, text[:-7])
    said = abreast("csv", "take.csv")
    assert said.code == 1
    assert f"line {lines} is cut off; left out of take.mcap, which is written" in said.err
    assert f"{ROWS - 1} rows" in said.out
    assert read_log(tmp_path / "take.mcap").topics


def test_a_damaged_line_in_the_middle_is_said(abreast: Abreast, tmp_path: Path) -> None:
    lines = motive_text(Motive(), pair_of_robots()).split(b"\n")
    lines[15] = lines[15][:40]
    lines[20] = lines[20].replace(b".", b"\0", 1)
    written(tmp_path, b"\n".join(lines))
    said = abreast("csv", "take.csv")
    assert said.code == 1
    assert "line 16 has 5 cells, expected 16; line 21 holds zero bytes" in said.err


def test_a_map_or_options_bring_the_scenario(abreast: Abreast, tmp_path: Path) -> None:
    written(tmp_path, motive_text(Motive(), pair_of_robots()))
    (tmp_path / "lab.toml").write_text("[scenario.leader]\nk_v = 7.0\n")
    assert abreast("csv", "take.csv", "--map", "lab.toml", "--out", "1.mcap").code == 0
    scenario = scenario_of(read_log(tmp_path / "1.mcap"))
    assert scenario is not None
    assert (scenario.name, scenario.leader.k_v, scenario.mocap.rate_hz) == ("lab", 7.0, 120.0)
    said = abreast(
        "csv", "take.csv", "--scenario", "turtlebot3", "--set", "leader.k_v=8.0", "--out", "2.mcap"
    )
    assert said.code == 0
    scenario = scenario_of(read_log(tmp_path / "2.mcap"))
    assert scenario is not None
    assert (scenario.name, scenario.leader.k_v) == ("take", 8.0)


def test_what_does_not_look_right_is_said_with_what_to_do(abreast: Abreast, tmp_path: Path) -> None:
    t = np.arange(240) / 120.0
    rows = [f"{at:.6f},{300 * at:.3f},0,{300 * at:.3f},-300,0" for at in t.tolist()]
    names = "t,leader_x,leader_y,follower_x,follower_y,follower_theta"
    written(tmp_path, "\n".join([names, *rows, ""]).encode())
    said = abreast("csv", "take.csv")
    assert said.code == 0
    assert '! the robots are 300 m apart: if positions are in mm, map them with unit = "mm"' in said.err
    assert "! the leader drives at 3e+02 m/s, leader.k_v is 0.1: add --set leader.k_v=3.6e+02" in said.err


def test_a_body_that_lies_on_its_side_is_said(abreast: Abreast, tmp_path: Path) -> None:
    pair = pair_of_robots()
    turned = (
        Rotation.from_quat(pair.follower[:, 3:]) * Rotation.from_euler("x", 90.0, degrees=True)
    ).as_quat()
    lying = Tracks(pair.t_ns, pair.leader, np.hstack([pair.follower[:, :3], turned]), pair.motion)
    written(tmp_path, motive_text(Motive(), lying))
    assert "! the follower is tilted by 9" in abreast("csv", "take.csv").err


MARKERS_ONLY = b"NO_OF_FRAMES\t1\nFREQUENCY\t100\nDATA_INCLUDED\t3D\nMARKER_NAMES\ta\tb\na X\tY\tZ\n1\t2\t3\n"


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (b"", (), "is empty; expected a line of column names"),
        (b"\x89MCAP0\r\n" + bytes(range(256)), (), "it is no text"),
        (MARKERS_ONLY, (), "holds 3D data, expected 6D; export 6DOF data as TSV"),
        (b"a,b\n1,2\n", (), "its columns are not known by their names; give --map FILE"),
        (b"a,b\n1,2\n", ("--leader", "A"), "is a table, which has no bodies; name columns by --map FILE"),
        (b"1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", (), "abreast import tum LEADER FOLLOWER"),
        (b"a,b\n1,2\n", ("--map", "lab.toml", "--scenario", "x"), "--scenario: the map says by which"),
        (b"Format Version,1.23,Take Name,A\n\n,Type\n", (), "no line that begins with Frame and Time"),
        (
            motive_text(Motive(unit="Meters", fields={"Length Units": "Furlongs"}), pair_of_robots()),
            (),
            "Length Units is 'Furlongs', expected Meters, Centimeters or Millimeters",
        ),
        (
            motive_text(Motive(), pair_of_robots()).replace(b"Rigid Body,", b"Bone,"),
            (),
            "has no rigid bodies; export with the option for rigid bodies switched on",
        ),
        (
            motive_text(Motive(), pair_of_robots()).replace(b"Quaternion", b"Gibbs"),
            (),
            "Rotation Type is 'Gibbs', expected Quaternion or an order such as XYZ",
        ),
        (
            motive_text(Motive(), pair_of_robots()),
            ("--map", "turtlebot3_lidar_optitrack"),
            "is an export of bodies; leave out [columns]",
        ),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_and_leaves_nothing(
    text: bytes, options: tuple[str, ...], said: str, abreast: Abreast, tmp_path: Path
) -> None:
    written(tmp_path, text)
    (tmp_path / "lab.toml").write_text('[columns]\nt = "a"\n')
    answer = abreast("csv", "take.csv", *options)
    assert answer.code == 2
    assert said in answer.err
    assert answer.err.count("\n") == 1
    assert not (tmp_path / "take.mcap").exists()


def test_trajectories_without_a_time_in_common_are_refused(abreast: Abreast, tmp_path: Path) -> None:
    pair = pair_of_robots()
    written(tmp_path, tum_text(pair.t_ns, pair.leader, comments=True), "l.txt")
    written(tmp_path, tum_text([t + 10**12 for t in pair.t_ns], pair.follower, comments=True), "f.txt")
    said = abreast("tum", "l.txt", "f.txt")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert "have no time in common (0.000 to 0.192 s and 1000.000 to 1000.192 s)" in said.err
