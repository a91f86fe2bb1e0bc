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
_KEPT_BLOCKS = 64  # one of every stream of a long chain, so that none is drawn again and again


class Stream(IntEnum):
    """Independent streams of random numbers of one run. Further agents of a chain have those that follow."""

    MOCAP = 0
    LEADER_ODOMETRY = 1
    FOLLOWER_ODOMETRY = 2


def block_length(stream: int) -> int:
    """Items of a stream drawn at once: about what half a minute has, as a generator is slow to set up."""
    return 4096 if stream == Stream.MOCAP else 1024


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

    bodies: tuple[tuple[float, ...], ...]
    delay: float
    lost: bool


def normals(seed: int, stream: int, index: int, count: int) -> tuple[float, ...]:
    """``count`` standard normals for the ``index``-th item of a stream."""
    block, row = divmod(index, block_length(stream))
    return tuple(_kept(seed, stream, block, count)[0][row].tolist())


def draw_frame(seed: int, index: int, delivery: Delivery, bodies: int = 2) -> Draw:
    """Random numbers of a mocap frame."""
    block, row = divmod(index, block_length(Stream.MOCAP))
    rows, shares = _kept(seed, Stream.MOCAP, block, 3 * bodies)
    normal, (late, lost) = tuple(rows[row].tolist()), shares[row].tolist()
    delay = delivery.latency - delivery.jitter * math.log1p(-late)
    each = tuple(normal[first : first + 3] for first in range(0, 3 * bodies, 3))
    return Draw(each, delay, lost < delivery.loss)


def draw_block(seed: int, stream: int, block: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Normals (n, count) of the n = :func:`block_length` items of a block, and for frames uniforms (n, 2)."""
    random = np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, 0, block]))
    n = block_length(stream)
    normal = random.standard_normal((n, count))
    return normal, random.random((n if stream == Stream.MOCAP else 0, 2))


_kept = functools.lru_cache(maxsize=_KEPT_BLOCKS)(draw_block)


def observe(pose: Pose, motion: Motion, noise: MocapNoise, normal: tuple[float, ...]) -> Pose:
    """Pose as mocap sees it: the noise rises from its static share to full with the body's motion."""
    activity = min(1.0, math.hypot(motion.v / _FULL_NOISE_SPEED, motion.u / _FULL_NOISE_TURN))
    scale = noise.static_fraction + (1.0 - noise.static_fraction) * activity
    return Pose(
        pose.x + scale * noise.sigma_position * normal[0],
        pose.y + scale * noise.sigma_position * normal[1],
        wrap(pose.theta + scale * noise.sigma_heading * normal[2]),
    )
