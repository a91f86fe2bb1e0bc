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

from formation.angles import wrap
from formation.pose import Motion, Pose

_FULL_NOISE_SPEED = 0.05
_FULL_NOISE_TURN = 0.2
_BLOCK = 64


class Stream(IntEnum):
    """Independent streams of random numbers of one run."""

    MOCAP = 0
    LEADER_ODOMETRY = 1
    FOLLOWER_ODOMETRY = 2


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
class Draw:
    """Random numbers of one frame: three standard normals per body, delay [s], and whether it is lost."""

    leader: tuple[float, ...]
    follower: tuple[float, ...]
    delay: float
    lost: bool


def normals(seed: int, stream: Stream, index: int, count: int) -> tuple[float, ...]:
    """``count`` standard normals for the ``index``-th item of a stream."""
    return _block(seed, stream, index // _BLOCK, count)[0][index % _BLOCK]


def draw_frame(seed: int, index: int, delivery: Delivery) -> Draw:
    """Random numbers of a mocap frame."""
    rows, shares = _block(seed, Stream.MOCAP, index // _BLOCK, 6)
    normal, (late, lost) = rows[index % _BLOCK], shares[index % _BLOCK]
    delay = delivery.latency - delivery.jitter * math.log1p(-late)
    return Draw(normal[:3], normal[3:], delay, lost < delivery.loss)


@functools.lru_cache(maxsize=16)
def _block(
    seed: int, stream: Stream, block: int, count: int
) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]]]:
    """Normals (_BLOCK, count) and uniforms (_BLOCK, 2) of a block; a generator is slow to set up."""
    random = np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, 0, block]))
    normal = random.standard_normal((_BLOCK, count)).tolist()
    return list(map(tuple, normal)), list(map(tuple, random.random((_BLOCK, 2)).tolist()))


def observe(pose: Pose, motion: Motion, noise: MocapNoise, normal: tuple[float, ...]) -> Pose:
    """Pose as mocap sees it: the noise rises from its static share to full with the body's motion."""
    activity = min(1.0, math.hypot(motion.v / _FULL_NOISE_SPEED, motion.u / _FULL_NOISE_TURN))
    scale = noise.static_fraction + (1.0 - noise.static_fraction) * activity
    return Pose(
        pose.x + scale * noise.sigma_position * normal[0],
        pose.y + scale * noise.sigma_position * normal[1],
        wrap(pose.theta + scale * noise.sigma_heading * normal[2]),
    )
