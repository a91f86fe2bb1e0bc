"""An emulated motion capture: noise that grows with motion, latency, jitter and loss.

All randomness is drawn from a counter-based generator by (seed, stream, block), so that it does not depend on
the order in which things are asked for.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from formation.angles import FloatArray
from formation.kernel import kernel
from formation.mount import NO_MOUNT, Mount, body_pose
from formation.pose import Pose
from formation.wrapping import wrapped
from hil.emulator.robot import Robot

_FULL_NOISE_SPEED = 0.05
_FULL_NOISE_TURN = 0.2
_NS = 1e-9


class Stream(IntEnum):
    """Independent streams of random numbers of one run. Further agents of a chain have those that follow."""

    MOCAP = 0
    LEADER_ODOMETRY = 1
    FOLLOWER_ODOMETRY = 2


class MocapNoise(NamedTuple):
    """Noise of a moving body per axis [m] and in heading [rad]; ``static_fraction`` of it at rest."""

    sigma_position: float
    sigma_heading: float
    static_fraction: float


class BodyNormals(NamedTuple):
    """Standard normals behind the noise of one body in one frame."""

    x: float
    y: float
    heading: float


class Shares(NamedTuple):
    """Uniform numbers from 0 to 1, that excluded, behind a frame's delay and its loss."""

    late: float
    lost: float


class SeenPose(NamedTuple):
    """What a frame says of a body, z up: position [m], and of its quaternion z and w; x and y are zero."""

    x: float
    y: float
    qz: float
    qw: float


class Delivery(NamedTuple):
    """How frames travel: latency and jitter (mean of its exponential part) [s], share lost."""

    latency: float
    jitter: float
    loss: float

    @kernel
    def time_on_the_way(self, shares: Shares) -> float:
        """How long a frame is on its way [s]."""
        if self.jitter == 0.0:
            return self.latency
        return self.latency - self.jitter * math.log1p(-shares.late)

    def varies(self) -> bool:
        """Whether anything depends on a frame's shares."""
        return self.jitter != 0.0 or self.loss > 0.0

    @kernel
    def loses(self, shares: Shares) -> bool:
        """Whether a frame never arrives."""
        return shares.lost < self.loss


class CaptureClock(NamedTuple):
    """The motion capture's own clock: ahead of the host's by ``offset`` [s], faster by ``drift`` (a share).

    It jumps by ``jump`` [s] when the leader has been driving for ``jump_at`` [s].
    """

    offset: float
    drift: float
    jump: float
    jump_at: float

    @kernel
    def reading_ns(self, at_ns: int, begun_ns: int, motion_since_ns: int) -> int:
        """What it shows at a host time, in a run that began, and whose leader set off, at the given ones.

        ``motion_since_ns`` is negative before the leader has set off.
        """
        ahead = self.offset + self.drift * (at_ns - begun_ns) * _NS
        if motion_since_ns >= 0 and (at_ns - motion_since_ns) * _NS >= self.jump_at:
            ahead = ahead + self.jump
        return at_ns + whole_ns(ahead)


@kernel
def whole_ns(seconds: float) -> int:
    """A time in whole nanoseconds; halves go up."""
    return math.floor(seconds / _NS + 0.5)


@kernel
def observe(robot: Robot, noise: MocapNoise, normal: BodyNormals, mount: Mount = NO_MOUNT) -> Pose:
    """Pose of a robot's body as mocap sees it: the noise rises from its static share to full with motion."""
    v, u = robot.motion.v / _FULL_NOISE_SPEED, robot.motion.u / _FULL_NOISE_TURN
    activity = min(1.0, math.sqrt(v * v + u * u))
    scale = noise.static_fraction + (1.0 - noise.static_fraction) * activity
    body = body_pose(Pose(robot.at.x, robot.at.y, robot.heading), mount)
    return Pose(
        body.x + scale * noise.sigma_position * normal.x,
        body.y + scale * noise.sigma_position * normal.y,
        wrapped(body.theta + scale * noise.sigma_heading * normal.heading),
    )


@kernel
def seen_pose(pose: Pose) -> SeenPose:
    """A pose as a frame, or odometry, tells it."""
    half = 0.5 * pose.theta
    return SeenPose(pose.x, pose.y, math.sin(half), math.cos(half))


def block_length(stream: int) -> int:
    """Items of a stream drawn at once: about what half a minute has, as a generator is slow to set up."""
    return 4096 if stream == Stream.MOCAP else 1024


def draw_block(seed: int, stream: int, block: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Normals (n, count) of the n = :func:`block_length` items of a block, and for frames uniforms (n, 2)."""
    n = block_length(stream)
    normal, shares = np.empty((n, count)), np.empty((n if stream == Stream.MOCAP else 0, 2))
    draw_into(normal, shares, seed, stream, block)
    return normal, shares


def draw_into(normal: FloatArray, shares: FloatArray, seed: int, stream: int, block: int) -> None:
    """Fill arrays with a block's numbers from the first on: standard normals, then uniform ones."""
    random = np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, 0, block]))
    random.standard_normal(out=normal)
    random.random(out=shares)
