"""What is written in some layout is what is read: more than forty by name, and any others by chance."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.log.reader import read_log
from hil.recordings.column_map import ColumnMap, load_column_map, no_map
from hil.recordings.imported import Imported, rate_of
from hil.recordings.track_import import import_recording, import_tum
from hil.wire import topics
from hil.wire.message_types import Odometry, RigidBodies
from hil.wire.messages import decode_as, to_ns
from tests.recording_layouts import (
    STYLES,
    Array,
    Motive,
    Qtm,
    Table,
    Tracks,
    motive_text,
    qtm_text,
    table_map,
    table_text,
    tracks,
    tum_text,
)

EPOCH_NS = 1_767_225_600_123_456_789
NO_MAP = no_map("lab", None)

TABLES = {
    "plain": Table(),
    "semicolons": Table(delimiter=";"),
    "decimal commas": Table(delimiter=";", decimal=","),
    "decimal commas and tabs": Table(delimiter="\t", decimal=","),
    "tabs": Table(delimiter="\t"),
    "bars": Table(delimiter="|"),
    "white space": Table(delimiter=" ", empty="nan"),
    "decimal commas and white space": Table(delimiter="  ", decimal=",", empty="nan"),
    "CRLF": Table(newline="\r\n"),
    "UTF-8 with mark": Table(encoding="utf-8-sig"),
    "UTF-16": Table(encoding="utf-16"),
    "UTF-16 without mark": Table(encoding="utf-16-le"),
    "UTF-16, big end first": Table(encoding="utf-16-be", delimiter="\t"),
    "letters": Table(names="lx"),
    "numbers": Table(names="x1"),
    "titles": Table(names="Leader X"),
    "paths": Table(names="leader.position.x"),
    "camels": Table(names="leaderX"),
    "role last": Table(names="x_leader"),
    "mm and degrees": Table(length="mm", angle="deg"),
    "cm in brackets": Table(length="cm", angle="deg", told="brackets"),
    "a line of units": Table(length="mm", angle="deg", time="ms", told="row"),
    "milliseconds": Table(time="ms"),
    "nanoseconds": Table(time="ns"),
    "nanoseconds in brackets": Table(time="ns", told="brackets"),
    "dates": Table(time="iso Z"),
    "dates with a zone": Table(time="iso+"),
    "dates without a zone": Table(time="isoT"),
    "dates, decimal commas": Table(time="iso Z", delimiter=";", decimal=","),
    "quaternions": Table(turned="quaternion"),
    "quaternions, mm": Table(turned="quaternion", length="mm", names="lx"),
    "odometry at a quarter": Table(odometry=4),
    "no odometry": Table(odometry=0),
    "lost as nan": Table(empty="NaN"),
    "lost as null": Table(empty="NULL"),
    "extra columns": Table(extra=True),
    "quotes": Table(quotes=True),
    "quotes, decimal commas": Table(quotes=True, decimal=","),
    "comments": Table(comments=True),
    "no end of line": Table(end=False),
    "blanks": Table(pad=True),
    "another order": Table(shuffled=3),
    "a map": Table(mapped=True, length="mm", names="leader.position.x"),
    "a map, y up": Table(mapped=True, turned="quaternion", up="y", odometry=0),
}
MOTIVES = {
    "1.21": Motive(version="1.21", error=True, markers=True),
    "1.23": Motive(),
    "1.25": Motive(version="1.25", unit="Millimeters", markers=True, strangers=2),
    "any order of keys": Motive(shuffled=5, unit="Centimeters"),
    "time code": Motive(version="1.24", timecode=True),
    "z up": Motive(up="z"),
    "Euler": Motive(rotation="XYZ", error=True),
    "Euler, another order": Motive(rotation="ZYX", up="z"),
    "Euler, y first": Motive(rotation="YZX", unit="Millimeters"),
    "CRLF, a mark, in the middle of a take": Motive(newline="\r\n", encoding="utf-8-sig", first=72210),
    "names of a lab": Motive(names=("RB 2 (lead)", "Tortue nº 1 follow"), strangers=1),
}
QTMS = {
    "both": Qtm(),
    "matrix": Qtm(turned="matrix", version=True, events=2),
    "angles": Qtm(turned="angles"),
    "no time": Qtm(timed=False, tab=False),
    "empty": Qtm(lost="empty", strangers=2),
    "null, decimal commas": Qtm(lost="null", decimal=",", newline="\n"),
}


def read(folder: Path, name: str, text: bytes, chart: ColumnMap = NO_MAP) -> tuple[Imported, Path]:
    (folder / name).write_bytes(text)
    return import_recording(folder / name, chart, folder / "log.mcap"), folder / "log.mcap"


def frames(log: Path) -> dict[int, dict[str, list[float]]]:
    """Poses of each body in the frames of a log by their times."""
    found: dict[int, dict[str, list[float]]] = {}
    for record in read_log(log).records([topics.RIGID_BODIES]):
        frame = decode_as(record.payload, RigidBodies)
        at_ns = to_ns(frame.header.stamp)
        assert record.log_ns == at_ns
        for body in frame.rigidbodies:
            p, q = body.pose.position, body.pose.orientation
            found.setdefault(at_ns, {})[body.rigid_body_name] = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    return found


def check_poses(log: Path, pair: Tracks) -> None:
    """All poses of the pair are in the log, at their times, and nothing else is."""
    found = frames(log)
    for row, t_ns in enumerate(pair.t_ns):
        bodies = found.pop(t_ns, {})
        for role, poses in (("leader", pair.leader), ("follower", pair.follower)):
            if np.isnan(poses[row]).any():
                assert role not in bodies
                continue
            assert bodies[role][:3] == pytest.approx(poses[row, :3].tolist(), abs=2e-9)
            # A quaternion and its opposite are one rotation.
            opposite = -poses[row, 3:]
            apart = min(math.dist(bodies[role][3:], turned) for turned in (poses[row, 3:], opposite))
            assert apart == pytest.approx(0.0, abs=3e-8)
    assert not found


def check_table(layout: Table, seed: int) -> None:
    start_ns = EPOCH_NS if layout.time.startswith("iso") else 0
    pair = tracks(seed, planar=layout.turned == "theta", gaps=layout.gaps, start_ns=start_ns)
    with TemporaryDirectory() as name:
        folder = Path(name)
        chart = NO_MAP
        if layout.mapped:
            (folder / "lab.toml").write_text(table_map(layout, pair))
            chart = load_column_map(str(folder / "lab.toml"))
        done, log = read(folder, "lab.csv", table_text(layout, pair), chart)
        assert done.damage == ()
        assert done.gaps == ({"leader": 3, "follower": 1} if layout.gaps else {})
        check_poses(log, pair)
        check_motion(log, pair, layout.odometry)


def check_motion(log: Path, pair: Tracks, every: int) -> None:
    found: dict[int, tuple[float, float]] = {}
    for record in read_log(log).records(["follower/odom"] if every else []):
        sample = decode_as(record.payload, Odometry)
        twist = sample.twist.twist
        found[to_ns(sample.header.stamp)] = (twist.linear.x, twist.angular.z)
    expected = {t: pair.motion[k].tolist() for k, t in enumerate(pair.t_ns) if every and k % every == 0}
    assert found.keys() == expected.keys()
    for t_ns, motion in expected.items():
        assert found[t_ns] == pytest.approx(motion, abs=1e-9)


@pytest.mark.parametrize("layout", TABLES.values(), ids=TABLES.keys())
def test_a_table_is_read_as_it_was_written(layout: Table) -> None:
    check_table(layout, seed=1)


@st.composite
def any_table(draw: st.DrawFn) -> Table:
    """Layouts of which one can tell what they are."""
    layout = draw(
        st.builds(
            Table,
            delimiter=st.sampled_from([",", ";", "\t", "|", " "]),
            decimal=st.sampled_from([".", ","]),
            newline=st.sampled_from(["\n", "\r\n"]),
            encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-32", "cp1252"]),
            names=st.sampled_from(STYLES),
            length=st.sampled_from(["m", "mm", "cm"]),
            angle=st.sampled_from(["rad", "deg"]),
            told=st.sampled_from(["suffix", "brackets", "row"]),
            time=st.sampled_from(["s", "ms", "ns", "iso Z", "iso+", "isoT", "isoZ"]),
            turned=st.sampled_from(["theta", "quaternion"]),
            odometry=st.sampled_from([0, 1, 4]),
            empty=st.sampled_from(["", "nan", "NULL", "-"]),
            extra=st.booleans(),
            quotes=st.booleans(),
            comments=st.booleans(),
            end=st.booleans(),
            pad=st.booleans(),
            shuffled=st.integers(0, 5),
            mapped=st.booleans(),
            up=st.sampled_from(["y", "z"]),
            gaps=st.booleans(),
        )
    )
    if layout.delimiter == ",":
        layout = replace(layout, decimal=".")
    if layout.delimiter == " ":
        layout = replace(layout, quotes=False, pad=False, names="lx", told="suffix", time="isoZ", empty="nan")
    if layout.up == "y":
        layout = replace(layout, turned="quaternion", mapped=True)
    # The last cell of a file without an end may be whatever its row lost.
    return replace(layout, end=True) if layout.gaps and layout.odometry == 4 else layout


@settings(max_examples=25, deadline=None)
@given(layout=any_table(), seed=st.integers(0, 1000))
def test_any_table_is_read_as_it_was_written(layout: Table, seed: int) -> None:
    check_table(layout, seed)


@pytest.mark.parametrize("layout", MOTIVES.values(), ids=MOTIVES.keys())
def test_an_export_of_motive_is_read_as_it_was_written(layout: Motive, tmp_path: Path) -> None:
    pair = tracks(2, planar=False, gaps=True, start_ns=722_100_000_000 if layout.first else 0)
    done, log = read(tmp_path, "take.csv", motive_text(layout, pair))
    assert (done.damage, done.gaps) == ((), {"leader": 3, "follower": 1})
    for fact in (layout.version, layout.unit.lower(), f"{layout.up} up", "120 Hz", *layout.names):
        assert fact in done.taken_for
    check_poses(log, pair)


@settings(max_examples=15, deadline=None)
@given(
    layout=st.builds(
        Motive,
        version=st.sampled_from(["1.21", "1.22", "1.23", "1.24", "1.25"]),
        unit=st.sampled_from(["Meters", "Centimeters", "Millimeters"]),
        rotation=st.sampled_from(["Quaternion", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]),
        up=st.sampled_from(["y", "z"]),
        error=st.booleans(),
        markers=st.booleans(),
        timecode=st.booleans(),
        strangers=st.integers(0, 2),
        shuffled=st.integers(0, 9),
        newline=st.sampled_from(["\n", "\r\n"]),
        encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    ),
    seed=st.integers(0, 1000),
)
def test_any_export_of_motive_is_read_as_it_was_written(layout: Motive, seed: int) -> None:
    pair = tracks(seed, planar=False, gaps=True)
    with TemporaryDirectory() as folder:
        done, log = read(Path(folder), "take.csv", motive_text(layout, pair))
        assert done.damage == ()
        check_poses(log, pair)


@pytest.mark.parametrize("layout", QTMS.values(), ids=QTMS.keys())
def test_an_export_of_qtm_is_read_as_it_was_written(layout: Qtm, tmp_path: Path) -> None:
    pair = tracks(3, planar=False, gaps=True)
    done, log = read(tmp_path, "take_6d.tsv", qtm_text(layout, pair))
    assert (done.damage, done.gaps) == ((), {"leader": 3, "follower": 1})
    for fact in ("QTM export", "millimeters", "z up", "120 Hz", *layout.names):
        assert fact in done.taken_for
    check_poses(log, pair)


@pytest.mark.parametrize("delimiter", [" ", "\t", ","])
@pytest.mark.parametrize("comments", [True, False])
def test_a_pair_of_trajectories_is_read_as_it_was_written(
    delimiter: str, comments: bool, tmp_path: Path
) -> None:
    pair = tracks(4, planar=False, gaps=False, start_ns=EPOCH_NS)
    paths = tmp_path / "leader.txt", tmp_path / "follower.txt"
    for path, poses in zip(paths, (pair.leader, pair.follower), strict=True):
        path.write_bytes(tum_text(pair.t_ns, poses, comments=comments, delimiter=delimiter))
    done = import_tum(*paths, NO_MAP, tmp_path / "log.mcap")
    assert (done.damage, done.gaps) == ((), {})
    check_poses(tmp_path / "log.mcap", pair)


def test_a_leader_whose_rows_come_in_bursts_is_there_between_them(tmp_path: Path) -> None:
    """Ten rows within 90 us, and 30 ms until the next ten, as a buffer passes on what it has gathered."""
    t = np.arange(0.0, 2.0, 0.01)
    bursts = np.sort((np.arange(0.0, 2.1, 0.03)[:, np.newaxis] + 1e-5 * np.arange(10)).ravel())
    paths = tmp_path / "l.txt", tmp_path / "f.txt"
    for path, times in zip(paths, (bursts, t), strict=True):
        zero = np.zeros_like(times)
        rows = np.column_stack([0.1 * times, zero, zero, zero, zero, zero, zero + 1.0])
        path.write_bytes(tum_text(np.round(times * 1e9).astype(int).tolist(), rows, comments=True))
    assert import_tum(*paths, NO_MAP, tmp_path / "log.mcap").gaps == {}
    assert rate_of(np.round(bursts * 1e9).astype(np.int64)) == pytest.approx(1.0 / 0.03, rel=0.01)
    assert import_tum(paths[1], paths[0], NO_MAP, tmp_path / "turned.mcap").gaps == {"leader": 30}


def test_a_leader_is_taken_between_its_rows_but_not_across_a_gap(tmp_path: Path) -> None:
    t = np.arange(0.0, 2.0, 0.01)

    def line(times: Array) -> Array:
        zero = np.zeros_like(times)
        return np.column_stack([0.1 * times, zero, zero, zero, zero, zero, zero + 1.0])

    led = t[(t < 0.5) | (t > 0.8)]
    paths = tmp_path / "l.txt", tmp_path / "f.txt"
    for path, times in zip(paths, (led, t[:-1] + 0.004), strict=True):
        path.write_bytes(tum_text(np.round(times * 1e9).astype(int).tolist(), line(times), comments=True))
    done = import_tum(*paths, NO_MAP, tmp_path / "log.mcap")
    assert "the leader between its own rows in 199 of 199" in done.taken_for
    found = frames(tmp_path / "log.mcap")
    lost = [t_ns for t_ns, bodies in found.items() if "leader" not in bodies]
    assert len(lost) == done.gaps["leader"] == 32
    assert all(0.49e9 < t_ns < 0.81e9 for t_ns in lost)
    for t_ns, bodies in found.items():
        assert bodies.get("leader", [t_ns * 1e-10])[0] == pytest.approx(t_ns * 1e-10, abs=1e-12)
