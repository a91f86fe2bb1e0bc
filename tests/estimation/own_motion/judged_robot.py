"""A robot in curves, its mocap track and its odometry, which may lie, as the judge of odometry sees them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
from estimation.own_motion.judged_odometry import with_own_track
from estimation.own_motion.odometry_check import (
    UNCHECKED,
    OdometryCheck,
    OdometrySample,
    WayEntry,
    with_sample,
)
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import OwnNoise, OwnPoint, folded, own_begun
from formation.pose import Motion, Pose, advance
from formation.records import plain_rows_of
from formation.ring import EMPTY

MS = 1_000_000
EPOCH_NS = 1_700_000_000_000 * MS
NOISE = OwnNoise(PoseNoise(3e-4, 3.5e-3), 0.22, 2.84)
TRUST = InputTrust(5e-3, 3e-2, v_max=0.22, u_max=2.84)
FRAME_NS, LATENCY_NS = 8 * MS, 30 * MS
_NOTHING = FollowerMotion(0.0, 0.0, 0.0, 0.0)

Lie = Callable[[float, Motion, Pose], "tuple[Motion, Pose | None] | None"]
"""What odometry tells at a time [s] of a motion and a pose; no pose, or no sample at all."""


def honest(t: float, motion: Motion, pose: Pose) -> tuple[Motion, Pose | None]:
    return motion, pose


def wavy(t: float) -> Motion:
    return Motion(0.1 + 0.04 * math.sin(0.9 * t), 0.3 + 0.5 * math.sin(1.5 * t))


class JudgedRobot:
    """Everything that the judge works with; ``check`` is what it has come to."""

    def __init__(
        self,
        *,
        seed: int = 1,
        drive: Callable[[float], Motion] = wavy,
        sample_ns: int = 32 * MS,
        late_s: float = 0.0,
        noise: float = 1.0,
    ) -> None:
        self.random = np.random.default_rng([seed, 17])
        self.drive, self.sample_ns, self.late_s, self.noise = drive, sample_ns, late_s, noise
        self.check: OdometryCheck = UNCHECKED
        self.own, self.ring = plain_rows_of(OwnPoint, 256), EMPTY
        self.ways = plain_rows_of(WayEntry, 64)
        self.at_ns, self.pose = EPOCH_NS, Pose(0.5, -0.2, 0.4)
        self.past: list[tuple[float, Motion, Pose]] = []
        self.frames: list[tuple[int, Pose]] = []

    @property
    def t(self) -> float:
        return (self.at_ns - EPOCH_NS) * 1e-9

    def run(self, until_s: float, lie: Lie = honest) -> Iterator[OdometryCheck]:
        """Go on until a time; the check after every sample."""
        while self.t < until_s:
            motion = self.drive(self.t)
            self.past.append((self.t, motion, self.pose))
            self._frame()
            if (self.at_ns - EPOCH_NS) % self.sample_ns == 0:
                self._sample(lie)
                yield self.check
            self.pose = advance(self.pose, motion.v, motion.u, FRAME_NS * 1e-9)
            self.at_ns += FRAME_NS

    def after(self, until_s: float, lie: Lie = honest) -> OdometryCheck:
        """The check when a time is over."""
        for _ in self.run(until_s, lie):
            pass
        return self.check

    def _frame(self) -> None:
        """A frame is captured, and the one that was on its way arrives."""
        x, y, theta = (self.noise * self.random.standard_normal(3) * [3e-4, 3e-4, 3.5e-3]).tolist()
        shown = Pose(self.pose.x + x, self.pose.y + y, self.pose.theta + theta)
        self.frames.append((self.at_ns, shown))
        while self.frames and self.frames[0][0] <= self.at_ns - LATENCY_NS:
            at_ns, pose = self.frames.pop(0)
            due = own_begun(at_ns, pose, False, _NOTHING, NOISE)
            self.ring = folded(self.own, self.ring, due, NOISE, 0.2)
            self._judge()

    def _sample(self, lie: Lie) -> None:
        moment = max(0.0, self.t - self.late_s)
        _, motion, pose = self.past[min(round(moment / (FRAME_NS * 1e-9)), len(self.past) - 1)]
        told = lie(self.t, motion, pose)
        if told is None:
            return
        (v, u), where = told
        v, u = v + 2e-3 * self.random.standard_normal(), u + 1e-2 * self.random.standard_normal()
        sample = OdometrySample(self.at_ns, v, u, where is not None, where or Pose(0.0, 0.0, 0.0))
        self.check = with_sample(self.check, self.ways, sample, NOISE)
        if self.ring.length:
            self._judge()

    def _judge(self) -> None:
        self.check = with_own_track(self.check, self.ways, self.own, self.ring, NOISE, TRUST)
