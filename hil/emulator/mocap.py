"""An emulated motion capture: noise that grows with motion, latency, jitter and loss.

All randomness is drawn from a counter-based generator by (seed, stream, index), so that it does not depend on
the order in which things are asked for.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from formation.angles import FloatArray, wrap
from formation.pose import Motion, Pose

_FULL_NOISE_SPEED = 0.05
_FULL_NOISE_TURN = 0.2
_NS = 1e-9


class Stream(IntEnum):
    """Independent streams of random numbers of one run."""

    MOCAP = 0
    LEADER_ODOMETRY = 1
    FOLLOWER_ODOMETRY = 2


BLOCK = {Stream.MOCAP: 4096, Stream.LEADER_ODOMETRY: 1024, Stream.FOLLOWER_ODOMETRY: 1024}
"""Items of a stream drawn at once: about what half a minute has, as a generator is slow to set up."""


@dataclass(frozen=True, slots=True)
class MocapNoise:
    """Noise of a moving body per axis [m] and in heading [rad]; ``static_fraction`` of it at rest."""

    sigma_position: float
    sigma_heading: float
    static_fraction: float


@dataclass(frozen=True, slots=True)
class Delivery:
    """How frames travel: latency and jitter (mean of its exponential part) [s], share lost."""

    latency: float
    jitter: float
    loss: float


@dataclass(frozen=True, slots=True)
class CaptureClock:
    """The motion capture's own clock: ahead of the host's by ``offset`` [s], faster by ``drift`` (a share).

    It jumps by ``jump`` [s] when the leader has been driving for ``jump_at`` [s].
    """

    offset: float = 0.0
    drift: float = 0.0
    jump: float = 0.0
    jump_at: float = 0.0

    def stamp_ns(self, at_ns: int, begun_ns: int, motion_since_ns: int | None) -> int:
        """What it shows at a host time, in a run that began, and whose leader set off, at the given ones."""
        ahead = self.offset + self.drift * (at_ns - begun_ns) * _NS
        if motion_since_ns is not None and (at_ns - motion_since_ns) * _NS >= self.jump_at:
            ahead += self.jump
        return at_ns + round(ahead / _NS)


@dataclass(frozen=True, slots=True)
class Draw:
    """Random numbers of one frame: three standard normals per body, delay [s], and whether it is lost."""

    leader: tuple[float, ...]
    follower: tuple[float, ...]
    delay: float
    lost: bool


def normals(seed: int, stream: Stream, index: int, count: int) -> tuple[float, ...]:
    """``count`` standard normals for the ``index``-th item of a stream."""
    block, row = divmod(index, BLOCK[stream])
    return tuple(_kept(seed, stream, block, count)[0][row].tolist())


def draw_frame(seed: int, index: int, delivery: Delivery) -> Draw:
    """Random numbers of a mocap frame."""
    block, row = divmod(index, BLOCK[Stream.MOCAP])
    rows, shares = _kept(seed, Stream.MOCAP, block, 6)
    normal, (late, lost) = tuple(rows[row].tolist()), shares[row].tolist()
    delay = delivery.latency - delivery.jitter * math.log1p(-late)
    return Draw(normal[:3], normal[3:], delay, lost < delivery.loss)


def draw_block(seed: int, stream: Stream, block: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Normals (n, count) of the n = ``BLOCK[stream]`` items of a block, and for frames uniforms (n, 2)."""
    random = np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, 0, block]))
    n = BLOCK[stream]
    normal = random.standard_normal((n, count))
    return normal, random.random((n if stream is Stream.MOCAP else 0, 2))


_kept = functools.lru_cache(maxsize=16)(draw_block)


def observe(pose: Pose, motion: Motion, noise: MocapNoise, normal: tuple[float, ...]) -> Pose:
    """Pose as mocap sees it: the noise rises from its static share to full with the body's motion."""
    activity = min(1.0, math.hypot(motion.v / _FULL_NOISE_SPEED, motion.u / _FULL_NOISE_TURN))
    scale = noise.static_fraction + (1.0 - noise.static_fraction) * activity
    return Pose(
        pose.x + scale * noise.sigma_position * normal[0],
        pose.y + scale * noise.sigma_position * normal[1],
        wrap(pose.theta + scale * noise.sigma_heading * normal[2]),
    )
