"""What messages hold, as numbers: records that kernels read from payloads and write into them."""

from __future__ import annotations

from typing import NamedTuple

from formation.kernel import kernel
from formation.pose import Pose

NS_PER_S = 1_000_000_000


class Stamp(NamedTuple):
    """A ROS 2 time: signed seconds since 1970, and nanoseconds that a payload may have out of range."""

    sec: int
    nanosec: int


class Placement(NamedTuple):
    """Pose of a body in space: position [m] and unit quaternion."""

    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


class Body(NamedTuple):
    """A body of a mocap frame; ``seen``: how often the frame names it, ``place``: the first time."""

    seen: int
    place: Placement


class FrameHead(NamedTuple):
    """A mocap frame but for the bodies that are known.

    ``sound``: it is one whole message. ``strangers``: how many bodies it has that nobody knows.
    """

    sound: bool
    stamp: Stamp
    frame_number: int
    strangers: int


class Wanted(NamedTuple):
    """What is wanted of a frame: places of leader and follower among its known bodies, and the latest stamp.

    A stamp after ``latest_ns`` lies in the future.
    """

    leader: int
    follower: int
    latest_ns: int


class Frame(NamedTuple):
    """A mocap frame, checked and reduced to the pair: leader at (x, y) [m], follower with its heading [rad].

    ``cause``: a :class:`hil.wire.message_checks.Cause`; with another than ACCEPTED only ``capture_ns``
    (0 without a good stamp), ``frame_number`` and ``strangers`` mean anything.
    """

    cause: int
    capture_ns: int
    frame_number: int
    strangers: int
    leader_x: float
    leader_y: float
    follower_x: float
    follower_y: float
    follower_theta: float

    @property
    def leader(self) -> tuple[float, float]:
        """Position of the leader."""
        return self.leader_x, self.leader_y

    @property
    def follower(self) -> Pose:
        """Pose of the follower."""
        return Pose(self.follower_x, self.follower_y, self.follower_theta)


class Odometry(NamedTuple):
    """A robot's own account of itself: place, speed v [m/s] along its x axis, turn rate u [rad/s] about z."""

    sound: bool
    stamp: Stamp
    place: Placement
    v: float
    u: float


class CheckedMotion(NamedTuple):
    """Measured motion of the follower, checked: v2 [m/s], u2 [rad/s], and the cause that refuses it.

    ``pose``: where it believes to be, in a frame of its own, if ``has_pose``.
    """

    cause: int
    stamp_ns: int
    v2: float
    u2: float
    has_pose: bool
    pose: Pose


class RangeAndBearing(NamedTuple):
    """A sighting as it came: rho [m], alpha2 [rad]."""

    sound: bool
    stamp: Stamp
    rho: float
    alpha2: float


class Sighting(NamedTuple):
    """A sighting of the leader, checked: rho [m], alpha2 [rad], and the cause that refuses it."""

    cause: int
    capture_ns: int
    rho: float
    alpha2: float


class Drive(NamedTuple):
    """A drive command: v [m/s] along x, u [rad/s] about z. Of a ``Twist``, which has none, the stamp is 0."""

    sound: bool
    stamp: Stamp
    v: float
    u: float


class EstimateNumbers(NamedTuple):
    """A ``LeaderEstimate`` without its covariance; see the ``.msg`` file for each number.

    ``reason``: number of the reason in its writer's table, -1 if it was read. ``consumed``: how many receipts
    it has.
    """

    capture_ns: int
    measured_ns: int
    computed_ns: int
    status: int
    reason: int
    consumed: int
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


class ReadEstimate(NamedTuple):
    """An estimate as it came; ``covariance_at``, ``receipts_at``: where these lie in the payload."""

    sound: bool
    covariance_at: int
    receipts_at: int
    numbers: EstimateNumbers


class CommandNumbers(NamedTuple):
    """A ``Command``; see the ``.msg`` file for each number.

    ``stop``: number of the reason in its writer's table, whose first is empty. ``consumed``: how many
    receipts it has.
    """

    stamp_ns: int
    capture_ns: int
    measured_ns: int
    stop: int
    consumed: int
    v2: float
    u2: float
    v2_wanted: float
    u2_wanted: float
    saturated: bool
    fresh: bool


class TruthNumbers(NamedTuple):
    """The numbers of a ``Truth``; see the ``.msg`` file for each."""

    stamp_ns: int
    frame_number: int
    leader_x: float
    leader_y: float
    leader_theta: float
    v1: float
    u1: float
    follower_x: float
    follower_y: float
    follower_theta: float
    v2: float
    u2: float


class ReadCommand(NamedTuple):
    """A decision as it came; ``receipts_at``: where these lie in the payload."""

    sound: bool
    receipts_at: int
    numbers: CommandNumbers


class ReadTruth(NamedTuple):
    """True states as they came; ``stamp`` may be no time."""

    sound: bool
    stamp: Stamp
    numbers: TruthNumbers


class Receipt(NamedTuple):
    """Receipt of one input: when it was taken in, and its digest, whose 64 bits stand for a signed number."""

    digest: int
    received_ns: int


@kernel
def stamp_of(ns: int) -> Stamp:
    """Stamp of a moment from 1970 to 2038."""
    return Stamp(ns // NS_PER_S, ns % NS_PER_S)


@kernel
def is_time(stamp: Stamp) -> bool:
    """Whether a stamp is a time after 1970, as a clock may give it."""
    return stamp.sec >= 0 and stamp.nanosec >= 0 and stamp.nanosec < NS_PER_S


@kernel
def ns_of(stamp: Stamp) -> int:
    """A stamp in nanoseconds; exact."""
    return stamp.sec * NS_PER_S + stamp.nanosec
