"""A scenario: everything that defines an experiment, as read from a TOML file.

SI units and radians throughout. Every key has a default except where a robot or a lab must decide;
an unknown key, a wrong type or a value out of range is a :class:`~hil.errors.UsageError`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, get_args

from msgspec import UNSET, Meta, UnsetType

from hil.scenario.emulated import MocapSection, RobotSection
from hil.scenario.lab import GuardSection, RecorderSection, SourceSection, WireSection
from hil.scenario.section import (
    BodyName,
    MountTriple,
    Name,
    Namespace,
    NonNegative,
    PoseTriple,
    Positive,
    Rate,
    Section,
    Span,
)

LawName = Literal["independent", "ideal", "feedforward", "faded"]
EstimatorName = Literal["ekf", "ukf", "ekf-filterpy", "ukf-filterpy", "imm", "shape-ekf", "mhe", "difference"]
OfflineName = Literal["smoother"]
OFFLINE_ESTIMATORS: tuple[OfflineName, ...] = get_args(OfflineName)
LAW_NAMES: tuple[LawName, ...] = get_args(LawName)
ESTIMATOR_NAMES: tuple[EstimatorName | OfflineName, ...] = (*get_args(EstimatorName), *OFFLINE_ESTIMATORS)
FrontEnd = Literal["world", "body"]
OwnMotion = Literal["odometry", "mocap", "fused", "auto"]
ProcessNoiseSource = Literal["estimated", "given"]
ClockName = Literal["trusted", "estimated"]
NoiseName = Literal["estimated", "given"]


class RunSection(Section, frozen=True, kw_only=True):
    """How long a run lasts, its random seed, and from when on it is judged."""

    duration_s: Positive = 30.0
    seed: Annotated[int, Meta(ge=0, le=2**62)] = 1
    evaluate_from_s: NonNegative = 15.0


class FormationSection(Section, frozen=True, kw_only=True):
    """The follower's station: its distance rho_0 [m], the leader's side, and the bearing it keeps it at.

    ``bearing``: angle [rad] between the follower's heading and the line to the leader, pi/2 abreast.
    ``change_sides_at_s``: when [s] the follower is told to go to the other side; of a pair only.
    """

    rho_0: Positive
    side: Literal["right", "left"] = "right"
    bearing: Annotated[float, Meta(gt=0.0, lt=math.pi)] = 0.5 * math.pi
    change_sides_at_s: tuple[NonNegative, ...] = ()


class ControllerSection(Section, frozen=True, kw_only=True):
    """The follower's law, its gains, and what the guard and the prediction assume.

    ``law``: independent of the leader's turn rate, ideal as the leader tells it, feedforward of the estimated
    one, faded of as much of that as its variance allows.
    ``max_age_s``: oldest measurement a command may rest on. ``lag_s``, ``transport_s``: actuator lag and
    command transport time that the prediction looks ahead by. ``v_resolution``, ``u_resolution``: steps of
    the robot's link, into which commands are rounded so that nothing is lost on average; 0 for a link that
    carries any value. ``command_type``: what the robot takes.
    ``tilt``: how far [rad] a follower that a speed limit holds back may turn off its bearing to close in.
    ``mount_check``: stop a follower whose body's heading is more than 5 degrees off its direction of travel,
    or only warn of it, so that it can be driven to calibrate.
    A law of one's own is ``file.py:function`` or ``package.module:function``; ``parameters`` are its gains.
    """

    law: str = "independent"
    mu1: Positive
    mu2: Positive
    mu_rho: Positive
    tilt: Annotated[float, Meta(ge=0.0, lt=1.57)] = 0.0
    parameters: dict[str, float] | UnsetType = UNSET
    v_max: Positive = 0.22
    u_max: Positive = 2.84
    max_age_s: Positive = 0.2
    lag_s: Span = 0.1
    transport_s: Span = 0.0
    tick_hz: Rate = 50.0
    v_resolution: NonNegative = 0.0
    u_resolution: NonNegative = 0.0
    command_type: Literal["TwistStamped", "Twist"] = "TwistStamped"
    mount_check: Literal["stop", "warn"] = "stop"


class ConstantProgram(Section, frozen=True, kw_only=True, tag="constant", tag_field="kind"):
    """Constant speed v and turn rate u."""

    v: NonNegative
    u: float = 0.0


class SinusoidProgram(Section, frozen=True, kw_only=True, tag="sinusoid", tag_field="kind"):
    """Constant speed v, turn rate u_mean + u_amplitude * sin(omega * t)."""

    v: NonNegative
    u_mean: float = 0.0
    u_amplitude: float
    omega: Positive


class ImpulseProgram(Section, frozen=True, kw_only=True, tag="impulse", tag_field="kind"):
    """Constant speed v, turn rate u_amplitude * exp(-(t - t_centre)^2 / (2 t_width^2))."""

    v: NonNegative
    u_amplitude: float
    t_centre: float
    t_width: Positive


class TableProgram(Section, frozen=True, kw_only=True, tag="table", tag_field="kind"):
    """Speed v and turn rate u at the times t, linear in between and held at the ends.

    With v < 0 the leader drives backwards: alpha1 is that of its direction of travel, and v1 = abs(v).
    """

    t: list[float]
    v: list[float]
    u: list[float]


class LeaderSection(Section, frozen=True, kw_only=True):
    """The leader: its start pose (x, y, theta), its program and the limits that are known of it.

    ``v_eps <= v1 <= k_v`` and ``|u1| <= k_u`` (Assumption 1 of the paper).
    ``mount``: where its rigid body sits on it, as far as is known: x [m] ahead of the middle of the wheel
    axis, y [m] to the left of it, yaw [rad] from the robot's heading to the body's.
    ``body``: what the motion capture calls it, name or streaming id. ``namespace``: of its topics, empty for
    none. Both are ``name`` where they are left out.
    """

    pose: PoseTriple
    program: ConstantProgram | SinusoidProgram | ImpulseProgram | TableProgram
    name: Name = "leader"
    body: BodyName | UnsetType = UNSET
    namespace: Namespace | UnsetType = UNSET
    v_eps: Positive = 0.02
    k_v: Positive
    k_u: Positive
    mount: MountTriple = (0.0, 0.0, 0.0)


class FollowerSection(Section, frozen=True, kw_only=True):
    """The follower: its start pose (x, y, theta), its names, and its body's mount as the leader's.

    In a chain every follower has this mount.
    """

    pose: PoseTriple
    name: Name = "follower"
    body: BodyName | UnsetType = UNSET
    namespace: Namespace | UnsetType = UNSET
    mount: MountTriple = (0.0, 0.0, 0.0)


class EstimatorSection(Section, frozen=True, kw_only=True):
    """The estimator: which one, what it measures with, and its noise by rule.

    ``front_end`` world: leader position and follower pose from mocap; body: range and bearing of the leader
    and the follower's own motion, taken as noisy. The motion is ``input_scale_v`` and ``input_scale_u`` times
    what a first-order lag of ``input_time_constant_s`` makes of its signal ``input_delay_s`` before; where
    commands stand in for odometry, up to ``input_lag_s`` later still.
    ``own_motion``: where v2 and u2 come from: odometry, the follower's own mocap track, both fused, or auto:
    odometry while the track bears it out, else the track.
    ``sigma_range``, ``sigma_bearing``: of a body-frame sensor; for mocap they follow from the geometry.
    ``noise``: estimated puts ``sigma_position``, ``sigma_heading``, ``sigma_range`` and ``sigma_bearing``
    right by what measurements tell, from a tenth to 30 times the value; given takes them as they stand.
    ``sensor_x``, ``sensor_y``: how far [m] such a sensor sits ahead of the middle of the follower's wheel
    axis and to its left. ``range_bias`` [m], ``bearing_bias`` [rad]: by how much its values are above the
    true ones.
    ``bias_states``: estimate what is left of these offsets, known beforehand to ``sigma_range_bias`` [m] and
    ``sigma_bearing_bias`` [rad], wherever the motion of the pair tells them (``ekf`` on the body front end).
    ``turn_bandwidth``: q_u = turn_bandwidth * k_u^2 per second (0.5 agile, 0.03 gentle leaders).
    ``clock``: trusted takes the stamps of mocap frames for host time; estimated maps them to it by what is
    seen of their delays, of which ``transport_latency_s`` is known to be the way.
    ``stamp_offset_s``: by how much trusted stamps are later than the robot's clock was at the capture.
    ``speed_bandwidth``: q_v = speed_bandwidth * k_v^2 per second (0.01 for leaders that drive evenly, 0.1
    for those that stop and go every few seconds).
    ``process_noise``: estimated finds both bandwidths by what is seen of the leader, from the given ones on,
    and notices steps of its speed and turn rate (``ekf``, ``ukf``); given takes them as they are.
    ``align_odometry``: odometry is corrected by the delay, lag and scales that the follower's mocap track
    shows.
    ``slip_v2``, ``slip_u2``: share of v2 and u2 by which slip may falsify odometry; on the body front end.
    ``settled_heading``: standard deviation [rad] of the leader's direction from which on a track is trusted
    with it, until it is 0.25 rad above that; 0 for what suits the estimator (0.35 for most).
    ``certify``: publish a guaranteed error radius of v1 and alpha1 beside every estimate.
    ``kind`` smoother is for replays only; an estimator of one's own is ``file.py:factory`` or
    ``package.module:factory``.
    """

    kind: str = "ekf"
    front_end: FrontEnd = "world"
    own_motion: OwnMotion = "auto"
    clock: ClockName = "trusted"
    transport_latency_s: Span = 0.0
    stamp_offset_s: Annotated[float, Meta(ge=-1e5, le=1e5)] = 0.0
    align_odometry: bool = False
    noise: NoiseName = "estimated"
    sigma_position: Positive = 0.0003
    sigma_heading: Positive = 0.0035
    sigma_range: Positive = 0.01
    sigma_bearing: Positive = 0.02
    sensor_x: float = 0.0
    sensor_y: float = 0.0
    range_bias: float = 0.0
    bearing_bias: float = 0.0
    bias_states: bool = False
    sigma_range_bias: Positive = 0.05
    sigma_bearing_bias: Positive = 0.1
    sigma_v2: Positive = 0.005
    sigma_u2: Positive = 0.03
    input_delay_s: NonNegative = 0.0
    input_lag_s: NonNegative = 0.0
    input_time_constant_s: NonNegative = 0.0
    input_scale_v: Positive = 1.0
    input_scale_u: Positive = 1.0
    slip_v2: NonNegative = 0.1
    slip_u2: NonNegative = 0.1
    settled_heading: NonNegative = 0.0
    turn_bandwidth: Positive = 0.5
    speed_bandwidth: Positive = 0.01
    process_noise: ProcessNoiseSource = "estimated"
    gate_probability: Annotated[float, Meta(gt=0.5, lt=1.0)] = 0.9999
    reacquire_frames: Annotated[int, Meta(ge=2)] = 5
    coast_after_s: Positive = 0.25
    lost_after_s: Positive = 1.0
    window_s: NonNegative = 0.2
    difference_cutoff_s: Positive = 0.1
    certify: bool = False


class ChainSection(Section, frozen=True, kw_only=True):
    """A chain of agents: each follows the one before it, within the controller's limits.

    The leader is the first agent and the follower the second. Every further agent starts in the same shape
    to its predecessor as the second to the first, and keeps to the same law, gains and limits.
    ``names``: of the agents from the third on; without them agent3, agent4 and so on. ``bodies`` and
    ``namespaces``: theirs in the motion capture and on the wire, where these are others. ``k_v``
    [m/s], ``k_u`` [rad/s]: what is known of a follower as somebody's predecessor, in place of the leader's;
    without them the lower of the controller's and the robot's limits.
    """

    agents: Annotated[int, Meta(ge=2, le=1000)]
    names: tuple[Name, ...] = ()
    bodies: tuple[BodyName, ...] = ()
    namespaces: tuple[Namespace, ...] = ()
    k_v: Positive | UnsetType = UNSET
    k_u: Positive | UnsetType = UNSET


class FlockSection(Section, frozen=True, kw_only=True):
    """A flock of agents in an arrowhead: each follows the mean of its nearest neighbours, within the limits.

    Its places have the distance ``formation.rho_0`` from each other and the leader at the tip; whom an agent
    follows it chooses anew every ``choose_every_s``, among those that it sees at least ``least_bearing``
    [rad] off straight ahead. The followers start off their places by at most ``scatter`` [m] along each axis
    and ``scatter_heading`` [rad], at random by ``run.seed``. The formation's side and bearing and the
    follower's pose are not looked at.
    """

    agents: Annotated[int, Meta(ge=2, le=2000)]
    neighbours: Annotated[int, Meta(ge=1, le=50)] = 3
    choose_every_s: Annotated[float, Meta(ge=0.01)] = 0.5
    least_bearing: Annotated[float, Meta(gt=0.0, le=0.5 * math.pi)] = math.pi / 7.0
    scatter: NonNegative = 0.0
    scatter_heading: Annotated[float, Meta(ge=0.0, le=math.pi)] = 0.0


class Scenario(Section, frozen=True, kw_only=True):
    """A whole experiment, its sections and their keys as ``docs/scenario.md`` has them; it does not change.

    Build it with :func:`hil.scenario.files.load_scenario`.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3")
    >>> scenario.formation.rho_0, scenario.estimator.kind
    (0.2, 'ekf')
    """

    name: str = ""
    description: str = ""
    run: RunSection = RunSection()
    formation: FormationSection
    controller: ControllerSection
    leader: LeaderSection
    follower: FollowerSection
    robot: RobotSection = RobotSection()
    mocap: MocapSection = MocapSection()
    estimator: EstimatorSection = EstimatorSection()
    source: SourceSection = SourceSection()
    wire: WireSection = WireSection()
    guard: GuardSection = GuardSection()
    recorder: RecorderSection = RecorderSection()
    chain: ChainSection | UnsetType = UNSET
    flock: FlockSection | UnsetType = UNSET
