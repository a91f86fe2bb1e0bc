"""The files that the commands of the docs suppose to be there: a lab's scenario, laws, recordings, logs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import abreast
from hil.log.opened import opened_log
from hil.replay.proposed_map import proposed_map
from tests.docs.pages import ROOT, blocks
from tests.recording_layouts import Array, Motive, Tracks, motive_text, tum_text

LAB = 'base = "turtlebot3"\n'
SWEEP = """\
scenario = "turtlebot3"
runs = 2
duration_s = 3.0
[grid]
sigma_position = [0.0003]
sigma_heading = [0.0035]
"""
DURATION_S = 6.0


def lay_out(folder: Path) -> None:
    """What is cheap: the lab's scenario, the spec of a sweep, and what pages tell one to save."""
    (folder / "my_lab.toml").write_text(LAB, encoding="utf-8")
    (folder / "my_sweep.toml").write_text(SWEEP, encoding="utf-8")
    for page in ("extend.md", "recordings.md"):
        for block in blocks(ROOT / "docs" / page):
            if block.file:
                (folder / block.file).write_text(block.text, encoding="utf-8")


def record(folder: Path) -> None:
    """A drive of some seconds, in all the forms in which the docs suppose it."""
    bag = folder / "my_bag"
    bag.mkdir()
    given = {"run.duration_s": DURATION_S, "run.evaluate_from_s": 3.0}
    driven = abreast.run_lockstep(abreast.load_scenario("turtlebot3", given), log=bag / "my_bag_0.mcap")
    shutil.copy(bag / "my_bag_0.mcap", folder / "run.mcap")
    shutil.copy(bag / "my_bag_0.mcap", folder / "drive.mcap")
    for place in ("before/1", "before/2", "after/1", "after/2", "logs/1", "logs/2"):
        (folder / place).parent.mkdir(exist_ok=True)
        shutil.copy(bag / "my_bag_0.mcap", folder / f"{place}.mcap")
    truth = driven.truth
    known = np.isfinite(truth.rho) & np.isfinite(truth.v1)
    t = truth.t[known] - truth.t[known][0]
    leader, follower = truth.leader[known], truth.follower[known]
    t_ns = np.rint(t * 1e9).astype(np.int64).tolist()
    pair = Tracks(t_ns, _posed(leader), _posed(follower), np.column_stack([truth.v2, truth.u2])[known])
    take = Motive(names=("RB 1", "RB 2"), up="z", gaps=False)
    (folder / "take.csv").write_bytes(motive_text(take, pair))
    for name, poses in (("leader", pair.leader), ("follower", pair.follower)):
        (folder / f"{name}.txt").write_bytes(tum_text(t_ns, poses, comments=True))
    _tables(folder, t, leader, follower, pair.motion)
    _data_set(folder / "MRCLAM_Dataset9", t, leader, follower, pair.motion)
    _earlier_runs(folder, given)


def _earlier_runs(folder: Path, given: Mapping[str, float]) -> None:
    """Runs of before: a pair, a chain, and a map of the bag's topics."""
    shutil.copytree(folder / "my_bag", folder / "runs" / "mine")
    (folder / "runs" / "mine" / "my_bag_0.mcap").rename(folder / "runs" / "mine" / "run.mcap")
    (folder / "runs" / "chain").mkdir()
    chain = abreast.load_scenario("chain5-turtlebot3", given)
    abreast.run_lockstep(chain, log=folder / "runs" / "chain" / "run.mcap")
    proposed = proposed_map(opened_log(folder / "my_bag"))
    (folder / "topics.toml").write_text(proposed, encoding="utf-8")


def _posed(planar: Array) -> Array:
    """Poses (n, 7) with quaternions from (n, 3)."""
    turned = Rotation.from_euler("z", planar[:, 2:3]).as_quat()
    return np.column_stack([planar[:, :2], np.full(len(planar), 0.1), turned])


def _tables(folder: Path, t: Array, leader: Array, follower: Array, motion: Array) -> None:
    away = leader[:, :2] - follower[:, :2]
    alpha2 = np.arctan2(away[:, 1], away[:, 0]) - follower[:, 2]
    columns = {
        "time": t,
        "rho_lidar_raw": np.hypot(*away.T),
        "alpha2_lidar_raw": np.arctan2(np.sin(alpha2), np.cos(alpha2)),
        "u2_cmd": motion[:, 1],
        "x1_mocap": leader[:, 0],
        "y1_mocap": leader[:, 1],
        "th1_mocap": leader[:, 2],
        "x2_mocap": follower[:, 0],
        "y2_mocap": follower[:, 1],
        "th2_mocap": follower[:, 2],
    }
    _table(folder / "my_recording.csv", {name: column[::12] for name, column in columns.items()})
    lab = {
        "stamp": 1e3 * t,
        "px_a": 1e3 * leader[:, 0],
        "py_a": 1e3 * leader[:, 1],
        "px_b": follower[:, 0],
        "py_b": follower[:, 1],
        "heading": (follower[:, 2] - 1.5708) / -0.0174533,
        "gyro": np.degrees(motion[:, 1]),
        "speed_a": np.full(len(t), 0.08),
    }
    _table(folder / "lab.csv", lab)


def _table(path: Path, columns: dict[str, Array]) -> None:
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt="%.9f", delimiter=",", header=",".join(columns), comments="")


def _data_set(folder: Path, t: Array, leader: Array, follower: Array, motion: Array) -> None:
    folder.mkdir()
    stamps = 1_248_444_200.0 + t
    for robot, poses in ((5, leader), (3, follower)):
        np.savetxt(folder / f"Robot{robot}_Groundtruth.dat", np.column_stack([stamps, poses]), fmt="%.6f")
        np.savetxt(folder / f"Robot{robot}_Odometry.dat", np.column_stack([stamps, motion]), fmt="%.6f")
