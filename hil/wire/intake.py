"""Reading what comes off the wire: nothing is trusted, and what is refused has a cause to count it by."""

from __future__ import annotations

import functools
import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import TypeVar

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.own_motion.odometry_history import MotionSample
from formation.pose import Pose
from hil.errors import AbreastError
from hil.wire import message_types as msg
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns

FARTHEST = 1e4
"""Largest coordinate or range [m] that is believed; beyond it the squares of a filter lose their meaning."""

FASTEST = 1e3
"""Largest speed [m/s] and turn rate [rad/s] of a robot that is believed."""

M = TypeVar("M", bound=msg.Message)

_UNIT_TOLERANCE = 0.01
_UPRIGHT = math.cos(math.radians(30.0))


class RefusedError(AbreastError):
    """An input that is not used; ``cause`` is the name it is counted by."""

    def __init__(self, cause: str) -> None:
        super().__init__(cause)
        self.cause = cause


@dataclass(frozen=True, slots=True)
class Frame:
    """A mocap frame, reduced to the pair. ``strangers``: bodies in it that nobody knows."""

    capture_ns: int
    frame_number: int
    leader: tuple[float, float]
    follower: Pose
    strangers: int


@dataclass(frozen=True, slots=True)
class Sighting:
    """Range [m] and bearing [rad] of the leader from the follower."""

    capture_ns: int
    rho: float
    alpha2: float


def read_frame(
    payload: bytes,
    leader: str,
    follower: str,
    now_ns: int | None = None,
    others: Collection[str] = (),
) -> Frame:
    """Decode and check a mocap frame; without ``now_ns`` its stamp may lie in the future.

    ``others``: names of bodies that are known to be there and not looked at.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, unknown_body (it holds strangers only),
    missing_leader, missing_follower, duplicate_body, not_finite, out_of_range, bad_quaternion, tilted (z is
    not up).
    """
    message = _decode_frame(payload)
    capture_ns = _stamp(message.header, now_ns)
    bodies: dict[str, msg.RigidBody] = {}
    strangers = 0
    for body in message.rigidbodies:
        if body.rigid_body_name not in (leader, follower):
            strangers += body.rigid_body_name not in others
        elif body.rigid_body_name in bodies:
            raise RefusedError("duplicate_body")
        else:
            bodies[body.rigid_body_name] = body
    if not bodies and strangers:
        raise RefusedError("unknown_body")
    if leader not in bodies:
        raise RefusedError("missing_leader")
    if follower not in bodies:
        raise RefusedError("missing_follower")
    first, second = _planar(bodies[leader].pose), _planar(bodies[follower].pose)
    return Frame(capture_ns, message.frame_number, (first.x, first.y), second, strangers)


def read_odometry(payload: bytes, now_ns: int) -> MotionSample:
    """Decode and check a robot's own motion.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, not_finite, out_of_range.
    """
    message = _decode(payload, msg.Odometry)
    twist = message.twist.twist
    v, u = twist.linear.x, twist.angular.z
    _within(FASTEST, v, u)
    return MotionSample(_stamp(message.header, now_ns), v, u)


def read_sighting(payload: bytes, now_ns: int) -> Sighting:
    """Decode and check a sighting of the leader.

    Raises :class:`RefusedError` by cause: malformed, bad_stamp, not_finite, out_of_range, bad_range (not
    above zero).
    """
    message = _decode(payload, msg.RangeBearing)
    _within(FARTHEST, message.rho, message.alpha2)
    if message.rho <= 0.0:
        raise RefusedError("bad_range")
    return Sighting(_stamp(message.header, now_ns), message.rho, message.alpha2)


def _decode(payload: bytes, kind: type[M]) -> M:
    try:
        return decode_as(payload, kind)
    except MalformedPayloadError:
        raise RefusedError("malformed") from None


@functools.lru_cache(maxsize=1)
def _decode_frame(payload: bytes) -> msg.RigidBodies:
    """A frame, decoded once for all followers that share a process. Nobody may change it."""
    return _decode(payload, msg.RigidBodies)


def _stamp(header: msg.Header, now_ns: int | None) -> int:
    try:
        stamp_ns = to_ns(header.stamp)
    except MalformedPayloadError:
        raise RefusedError("bad_stamp") from None
    if now_ns is not None and stamp_ns > now_ns + CLOCK_TOLERANCE_NS:
        raise RefusedError("bad_stamp")
    return stamp_ns


def _within(bound: float, *values: float) -> None:
    if not all(map(math.isfinite, values)):
        raise RefusedError("not_finite")
    if max(map(abs, values)) > bound:
        raise RefusedError("out_of_range")


def _planar(pose: msg.Pose) -> Pose:
    """Ground pose of a body with z up; the heading is the yaw of its x axis."""
    p, q = pose.position, pose.orientation
    _within(FARTHEST, p.x, p.y, p.z, q.x, q.y, q.z, q.w)
    norm = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    if abs(norm - 1.0) > _UNIT_TOLERANCE:
        raise RefusedError("bad_quaternion")
    x, y, z, w = q.x / norm, q.y / norm, q.z / norm, q.w / norm
    if 1.0 - 2.0 * (x * x + y * y) < _UPRIGHT:
        raise RefusedError("tilted")
    return Pose(p.x, p.y, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
