"""What a replay keeps of every message for its judge: rows of numbers, in the order of the log."""

from __future__ import annotations

from typing import NamedTuple

from formation.byte_access import read_float
from formation.kernel import kernel
from hil.wire.records import CommandNumbers, EstimateNumbers

_DIAGONAL_BYTES = 6 * 8


class EstimateRow(NamedTuple):
    """An estimate: numbers and units of ``LeaderEstimate.msg``, ``var_*`` the diagonal of the covariance."""

    capture_ns: int
    computed_ns: int
    status: int
    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    v1: float
    alpha1: float
    u1: float
    v2: float
    u2: float
    nis: float
    bound_v1: float
    bound_alpha1: float
    bound_h: float
    var_rho_dot: float
    var_alpha2_dot: float
    var_v1: float
    var_alpha1: float
    var_u1: float


class CommandRow(NamedTuple):
    """A decision: when it was issued, the capture behind it, why it stops (0: it does not), what was sent."""

    issued_ns: int
    capture_ns: int
    stop: int
    v2: float
    u2: float
    v2_wanted: float
    saturated: bool
    fresh: bool


class TruthRow(NamedTuple):
    """The true states of a pair at a capture."""

    capture_ns: int
    frame_number: int
    leader_x: float
    leader_y: float
    leader_theta: float
    follower_x: float
    follower_y: float
    follower_theta: float
    v1: float
    u1: float
    v2: float
    u2: float


class PoseRow(NamedTuple):
    """Pose of the follower by its mocap track, captured at a time of the host's clock."""

    capture_ns: int
    x: float
    y: float
    theta: float


class MotionRow(NamedTuple):
    """Motion of the follower by its odometry."""

    stamp_ns: int
    v2: float
    u2: float


class DriveRow(NamedTuple):
    """A drive command by its digest; ``place``: number of the output that it went out with, -1 as logged."""

    digest: int
    place: int


@kernel
def estimate_row(n: EstimateNumbers, payload: bytes, covariance_at: int) -> EstimateRow:
    """What is kept of an estimate whose covariance stands in its payload."""
    return EstimateRow(
        n.capture_ns,
        n.computed_ns,
        n.status,
        n.rho,
        n.alpha2,
        n.rho_dot,
        n.alpha2_dot,
        n.v1,
        n.alpha1,
        n.u1,
        n.v2,
        n.u2,
        n.nis,
        n.bound_v1,
        n.bound_alpha1,
        n.bound_h,
        read_float(payload, covariance_at),
        read_float(payload, covariance_at + _DIAGONAL_BYTES),
        read_float(payload, covariance_at + 2 * _DIAGONAL_BYTES),
        read_float(payload, covariance_at + 3 * _DIAGONAL_BYTES),
        read_float(payload, covariance_at + 4 * _DIAGONAL_BYTES),
    )


@kernel
def command_row(n: CommandNumbers) -> CommandRow:
    """What is kept of a decision."""
    return CommandRow(n.stamp_ns, n.capture_ns, n.stop, n.v2, n.u2, n.v2_wanted, n.saturated, n.fresh)
