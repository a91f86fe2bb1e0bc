"""What an estimator is fixed by, what it works in, and what it hands from step to step."""

from __future__ import annotations

from typing import NamedTuple

from estimation.consistency.filter_bank import Member
from estimation.consistency.noise_estimate import NOISE_GIVEN, NoiseEstimate, NoiseLearning
from estimation.consistency.process_estimate import LearnedProcess, ProcessLearning
from estimation.consistency.slip_estimate import LearnedSlip
from estimation.filters.filter import Filter
from estimation.models.measurement import PoseNoise
from estimation.own_motion.odometry_check import OdometryCheck, WayEntry
from estimation.own_motion.odometry_history import Correction, InputTrust, MotionSample
from estimation.own_motion.odometry_noise import OdometryNoise
from estimation.own_motion.own_track import OwnNoise, OwnPoint
from estimation.tracking.estimate import Estimate
from estimation.tracking.mount_check import MountCheck
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.track_settings import TrackSettings
from estimation.tracking.travel_watch import TravelWatch
from formation.mount import NO_MOUNT, Mount
from formation.records import Rows
from formation.ring import Ring

ODOMETRY, MOCAP, FUSED, AUTO = 0, 1, 2, 3
"""Where the follower's motion is known from; AUTO: from odometry while nothing speaks against it."""


class MountRules(NamedTuple):
    """Where the follower's body sits, and whether it is stopped if that is plainly wrong."""

    follower: Mount
    stops: bool


NO_MOUNT_RULES = MountRules(NO_MOUNT, stops=False)


class Rules(NamedTuple):
    """All that is fixed about an estimator.

    source: where the follower's motion is from. reprocesses: whether odometry that comes late is folded in
    again. span: seconds of odometry kept. noise: of a mocap pose. mounts: of the follower's
    body. noise_learning: by what the noise is put right. learns_slip: whether what the follower's motion is
    worth is found from sightings.
    """

    settings: TrackSettings
    filter: Filter
    source: int
    reprocesses: bool
    span: float
    noise: PoseNoise
    trust: InputTrust
    own_noise: OwnNoise
    process_learning: ProcessLearning
    mounts: MountRules = NO_MOUNT_RULES
    noise_learning: NoiseLearning = NOISE_GIVEN
    learns_slip: bool = False


class Memory(NamedTuple):
    """Rows that an estimator works in: the leader's track, odometry, the follower's own track, and more.

    By the ``ways`` that both have gone odometry is judged. ``bank``: filters of other process noise and of
    other slip, by which these are found.
    """

    points: Rows[TrackPoint]
    history: Rows[MotionSample]
    own: Rows[OwnPoint]
    ways: Rows[WayEntry]
    bank: Rows[Member]


class Known(NamedTuple):
    """Where the rows are filled, by what odometry is corrected, and how far it is believed.

    ``watched_ns``: capture of the first frame since when odometry is missed, 0 before. ``noise``: of
    measurements, as they tell it. ``process``: what is known of how the leader drives. ``travel``: which
    way the leader went, where it is seen in the world. ``mount_check``: what is left of the follower's mount.
    ``odometry_noise``: what odometry shows to be its errors. ``slip``: what of them sightings show.
    ``answer``: of a lag to its newest sample.
    """

    track: Ring
    odometry: Ring
    own: Ring
    correction: Correction
    odometry_check: OdometryCheck
    watched_ns: int
    noise: NoiseEstimate
    process: LearnedProcess
    travel: TravelWatch
    mount_check: MountCheck
    odometry_noise: OdometryNoise
    slip: LearnedSlip
    answer: MotionSample


class Taken(NamedTuple):
    """What became of a frame or sighting: verdict and cause; ``late``: captured before the newest."""

    verdict: int
    cause: int
    late: bool


class Told(NamedTuple):
    """An estimate, and why the newest measurement was not used."""

    estimate: Estimate
    cause: int
