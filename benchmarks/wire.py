"""Microseconds to read and write one message from Python: by the kernels, and by rosbags as before.

    python benchmarks/wire.py [--rounds 15]

The two take turns; medians of the rounds, in time of the process.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import layouts
from formation.pose import Motion, Pose
from formation.records import Rows, row_of, rows_of, store
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.emulator.mocap import seen_pose
from hil.wire import entries, templates
from hil.wire import message_types as msg
from hil.wire.cdr import packed_texts
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.message_checks import ANY_TIME_NS
from hil.wire.messages import decode_as, encode, header, to_time
from hil.wire.records import (
    Body,
    CommandNumbers,
    EstimateNumbers,
    FrameHead,
    Odometry,
    Placement,
    Receipt,
    Stamp,
    TruthNumbers,
    Wanted,
)

NOW_NS = 1_700_000_000_000_000_000
CALLS = 300
PAIR = (Pose(1.0, 2.0, 0.3), Pose(0.5, 1.5, -0.4))
NAMES = ("leader", "follower")
RECEIPTS = 3
NUMBERS = EstimateNumbers(NOW_NS, NOW_NS, NOW_NS, 1, 0, RECEIPTS, *[0.5] * 13)


def upright(pose: Pose) -> Placement:
    """Place of a body with z up that stands on the ground."""
    seen = seen_pose(pose)
    return Placement(seen.x, seen.y, 0.0, 0.0, 0.0, seen.qz, seen.qw)


def bodies_of(poses: tuple[Pose, ...]) -> Rows[Body]:
    rows = rows_of(Body, len(poses))
    for k, pose in enumerate(poses):
        store(rows, k, Body(1, upright(pose)))
    return rows


def frames() -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    payload = encode(frame_message(NOW_NS, 7, zip(NAMES, PAIR, strict=True)))
    names, heads, bodies, wanted = (
        packed_texts(NAMES),
        rows_of(FrameHead, 1),
        rows_of(Body, 2),
        row_of(Wanted(0, 1, ANY_TIME_NS)),
    )
    shown, frame = bodies_of(PAIR), templates.frame_template("mocap", NAMES)

    def write() -> bytes:
        layouts.write_frame(frame.buffer, frame.places_at, NOW_NS, 7, shown)
        return frame.buffer.tobytes()

    return {
        "read frame": (
            lambda: entries.take_frame(payload, names, heads, bodies, wanted),
            lambda: decode_as(payload, msg.RigidBodies),
        ),
        "write frame": (
            write,
            lambda: encode(frame_message(NOW_NS, 7, zip(NAMES, PAIR, strict=True))),
        ),
    }


def motions() -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    odometry = encode(odometry_message(NOW_NS, "follower", PAIR[1], Motion(0.1, 0.2)))
    own, sample = (
        templates.odometry_template("follower/odom", "follower/base_footprint"),
        Odometry(True, Stamp(0, 0), upright(PAIR[1]), 0.1, 0.2),
    )
    drive = templates.drive_template("follower", stamped=True)
    command = encode(drive_message(Motion(0.1, 0.2), NOW_NS, "follower", stamped=True))

    def write_odometry() -> bytes:
        layouts.write_odometry(own.buffer, own.numbers_at, NOW_NS, sample)
        return own.buffer.tobytes()

    def write_drive() -> bytes:
        entries.write_drive(drive.buffer, drive.numbers_at, NOW_NS, 0.1, 0.2)
        return drive.buffer.tobytes()

    return {
        "read odometry": (
            lambda: entries.take_odometry(odometry, ANY_TIME_NS),
            lambda: decode_as(odometry, msg.Odometry),
        ),
        "write odometry": (
            write_odometry,
            lambda: encode(odometry_message(NOW_NS, "follower", PAIR[1], Motion(0.1, 0.2))),
        ),
        "read drive": (
            lambda: entries.read_drive(command, True),
            lambda: read_drive(command, stamped=True),
        ),
        "write drive": (
            write_drive,
            lambda: encode(drive_message(Motion(0.1, 0.2), NOW_NS, "follower", stamped=True)),
        ),
    }


def decisions() -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    reasons, numbers, covariance = packed_texts(["", "late"]), row_of(NUMBERS), np.arange(25.0)
    receipts = rows_of(Receipt, RECEIPTS)
    for k in range(RECEIPTS):
        store(receipts, k, Receipt(k, NOW_NS))
    now = to_time(NOW_NS)
    consumed = [msg.Consumed(k, now) for k in range(RECEIPTS)]
    seen: list[Any] = [
        header(NOW_NS, "f"),
        now,
        now,
        *[0.5] * 9,
        covariance,
        0.5,
        1,
        "",
        0.5,
        0.5,
        0.5,
        consumed,
    ]
    estimate = msg.LeaderEstimate(*seen)
    payload, ours = encode(estimate), templates.estimate_template("f", RECEIPTS)
    decided: list[Any] = [NOW_NS, NOW_NS, NOW_NS, 0, RECEIPTS, *[0.5] * 4, False, True]
    decision = row_of(CommandNumbers(*decided))
    sent: list[Any] = [header(NOW_NS, "f"), now, now, *[0.5] * 4, False, "", True, consumed]
    command = msg.Command(*sent)
    ours_too, truth = templates.command_template("f", RECEIPTS), templates.truth_template("mocap")
    states, states_of = row_of(TruthNumbers(NOW_NS, 7, *[0.5] * 10)), [0.5] * 10

    def write_truth() -> bytes:
        layouts.write_truth(truth.buffer, truth.numbers_at, states)
        return truth.buffer.tobytes()

    return {
        "read estimate": (
            lambda: layouts.take_estimate(payload, numbers, covariance),
            lambda: decode_as(payload, msg.LeaderEstimate),
        ),
        "write estimate": (
            lambda: ours.payload(
                layouts.write_estimate(ours.buffer, ours.numbers_at, reasons, numbers, covariance, receipts)
            ),
            lambda: encode(estimate),
        ),
        "write command": (
            lambda: ours_too.payload(
                layouts.write_command(ours_too.buffer, ours_too.numbers_at, reasons, decision, receipts)
            ),
            lambda: encode(command),
        ),
        "write truth": (
            write_truth,
            lambda: encode(msg.Truth(header(NOW_NS, "mocap"), 7, *states_of)),
        ),
    }


def microseconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    for _ in range(CALLS):
        work()
    return (time.process_time() - begin) / CALLS * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    works = frames() | motions() | decisions()
    took = {
        name: [(microseconds(a), microseconds(b)) for _ in range(given.rounds)]
        for name, (a, b) in works.items()
    }
    print(f"{'':16}{'kernels':>10}{'rosbags':>10}{'ratio':>8}   us")
    for name, pairs in took.items():
        ours, theirs = np.median(np.array(pairs), axis=0)
        print(f"{name:16}{ours:10.2f}{theirs:10.2f}{theirs / ours:8.1f}")


if __name__ == "__main__":
    main()
