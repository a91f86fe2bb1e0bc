"""Replay of a log as a whole command, beside the script that a lab member would write.

    python benchmarks/replay.py [--seconds 600] [--rate 240] [--rounds 5] [--log LOG] [--against CHECKOUT]

The log is one of ``turtlebot3`` in lockstep. The script reads frames and odometry with the ``mcap`` package,
decodes them with ``rosbags``, filters distance and bearing with filterpy's EKF and prints the speed and
bearing of Eq. (7); ``abreast replay --verify`` makes every estimate and every command anew, compares them
with the log and judges them. Whole processes take turns; printed are medians, the ratios within a round, and
peak memory. ``--against``: another checkout of this project, to replay with as well.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


class Took(NamedTuple):
    """What a process took: seconds, those of the processor, and memory at its peak [MB]."""

    wall: float
    cpu: float
    peak: float


def plain(path: str) -> None:
    """The script: leader's speed and bearing from frames and odometry by an EKF and Eq. (7)."""
    import numpy as np
    from filterpy.kalman import ExtendedKalmanFilter
    from mcap.reader import make_reader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    known: set[str] = set()
    ekf: Any = ExtendedKalmanFilter(dim_x=4, dim_z=2)
    ekf.P, ekf.R, jacobian = np.diag([1e-4, 1e-4, 0.1, 0.1]), np.diag([1e-6, 1e-5]), np.eye(2, 4)
    last, v2, u2, estimates = math.nan, 0.0, 0.0, []
    with open(path, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages(["rigid_bodies", "follower/odom"]):
            assert schema is not None
            if schema.name not in known:
                types = get_types_from_msg(schema.data.decode(), schema.name)
                store.register({name: kind for name, kind in types.items() if name not in store.fielddefs})
                known.add(schema.name)
            told: Any = store.deserialize_cdr(message.data, schema.name)
            if channel.topic == "follower/odom":
                v2, u2 = told.twist.twist.linear.x, told.twist.twist.angular.z
                continue
            t = told.header.stamp.sec + 1e-9 * told.header.stamp.nanosec
            pose = {body.rigid_body_name: body.pose for body in told.rigidbodies}
            leader, follower = pose["leader"].position, pose["follower"].position
            q = pose["follower"].orientation
            heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
            dx, dy = leader.x - follower.x, leader.y - follower.y
            seen = np.array([math.hypot(dx, dy), math.remainder(math.atan2(dy, dx) - heading, math.tau)])
            if math.isnan(last):
                ekf.x, last = np.array([*seen, 0.0, 0.0]), t
                continue
            ekf.F[0, 2] = ekf.F[1, 3] = t - last
            ekf.Q[2, 2] = ekf.Q[3, 3] = 0.3 * (t - last)
            last = t
            ekf.predict()
            ekf.update(seen, lambda x: jacobian, lambda x: x[:2])
            rho, alpha2, rho_dot, alpha2_dot = ekf.x
            along = -rho_dot - v2 * math.cos(alpha2)
            across = rho * (alpha2_dot + u2) - v2 * math.sin(alpha2)
            estimates.append((t, math.hypot(along, across), math.atan2(across, along)))
    print(f"{len(estimates)} estimates, the last {estimates[-1]}")


def took(command: list[str], checkout: Path = ROOT) -> Took:
    """Run a command to its end."""
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    begun = time.perf_counter()
    process = subprocess.Popen(
        command, cwd=checkout, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begun
    assert os.waitstatus_to_exitcode(status) == 0, command
    process.returncode = 0
    return Took(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3)


def made_log(folder: Path, seconds: float, rate: float) -> Path:
    options = ["--set", f"mocap.rate_hz={rate}", "--set", f"run.duration_s={seconds}"]
    command = [sys.executable, "-m", "hil", "run", "turtlebot3", "--lockstep", *options, "--out"]
    took([*command, str(folder / "run")])
    return folder / "run" / "run.mcap"


def compare(log: Path, rounds: int, against: Path | None) -> None:
    replay = [sys.executable, "-m", "hil", "replay", str(log), "--verify"]
    ways = {
        "plain script": ([sys.executable, str(Path(__file__).resolve()), "--plain", str(log)], ROOT),
        "abreast replay": (replay, ROOT),
    }
    if against is not None:
        ways["replay before"] = (replay, against)
    found: dict[str, list[Took]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, (command, checkout) in ways.items():
            found[name].append(took(command, checkout))
    print(
        f"log of {log.stat().st_size / 1e6:.1f} MB: seconds, of the processor, peak MB, speed over the script"
    )
    for name, each in found.items():
        middle = Took(*map(median, zip(*each, strict=True)))
        ratio = median(a.wall / b.wall for a, b in zip(found["plain script"], each, strict=True))
        print(f"{name:<15}{middle.wall:10.2f}{middle.cpu:10.2f}{middle.peak:10.0f}   {ratio:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--rate", type=float, default=240.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--log", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--plain", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.plain is not None:
        plain(given.plain)
        return
    with tempfile.TemporaryDirectory() as folder:
        log = given.log.resolve() if given.log else made_log(Path(folder), given.seconds, given.rate)
        compare(log, given.rounds, given.against)


if __name__ == "__main__":
    main()
