"""Sections of a scenario that the emulator goes by: its robots, its motion capture, and their faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta

from hil.scenario.section import (
    Acceleration,
    Angle,
    Coordinate,
    Factor,
    Lag,
    Moment,
    MountTriple,
    Noise,
    Probability,
    Rate,
    Resolution,
    Section,
    Span,
    SpeedLimit,
    TurnLimit,
)


class OdometryFaultSection(Section, frozen=True, kw_only=True):
    """A fault of the emulated odometry of all followers, ``at_s`` after the leader set off.

    ``silent``: no samples; ``nan``: a twist of NaN; ``zero``: a twist of 0 with a right pose; ``reversed``:
    both with the opposite sign; ``scale``: both times ``factor``; ``delay``: samples come, and are stamped,
    ``delay_s`` later; ``commands``: the twist tells what the robot was told to drive; ``slip``: the share
    ``factor`` |u2| (u2 in rad/s, at most 0.9) of what the wheels turn is lost; ``reset``: the pose begins
    anew at its origin, once. ``duration_s`` 0 stands for good.
    """

    EXAMPLE: ClassVar[Mapping[str, Any]] = {"kind": "scale", "at_s": 18, "duration_s": 5, "factor": 0.5}

    kind: Literal["silent", "nan", "zero", "reversed", "scale", "delay", "slip", "reset", "commands"]
    at_s: Moment
    duration_s: Moment = 0.0
    factor: Annotated[float, Meta(ge=-1e3, le=1e3)] = 0.5
    delay_s: Span = 0.2


class RobotSection(Section, frozen=True, kw_only=True):
    """The emulated robots: first-order actuator lag, limits, command resolution, wheel odometry.

    ``v_rate`` [m/s^2], ``u_rate`` [rad/s^2]: how fast a guard lets speed and turn rate change, 0 for any.

    Odometry is noisy, stamped ``odometry_delay_s`` later than the motion that it tells of, and tells the
    motion times ``odometry_scale_v`` and ``odometry_scale_u``; its pose adds that up, without noise.
    """

    lag_s: Lag = 0.1
    v_max: SpeedLimit = 0.22
    u_max: TurnLimit = 2.84
    v_rate: Acceleration = 0.0
    u_rate: Acceleration = 0.0
    v_resolution: Resolution = 0.01
    u_resolution: Resolution = 0.01
    odometry_rate_hz: Rate = 30.0
    odometry_sigma_v: Noise = 0.002
    odometry_sigma_u: Noise = 0.01
    odometry_delay_s: Span = 0.0
    odometry_scale_v: Factor = 1.0
    odometry_scale_u: Factor = 1.0
    odometry_faults: tuple[OdometryFaultSection, ...] = ()


class FaultSection(Section, frozen=True, kw_only=True):
    """A fault of the emulated motion capture, ``at_s`` after the leader set off; the truth stays true.

    ``step``: a body shown ``offset`` [m] aside; ``turn``: turned by ``angle`` [rad]; ``swap``: each body
    under the other's name; ``freeze``: a body's last pose again and again; ``dropout``: no frames.
    ``duration_s`` 0 stands for one frame.
    """

    EXAMPLE: ClassVar[Mapping[str, Any]] = {"kind": "dropout", "at_s": 18, "duration_s": 1}

    kind: Literal["step", "turn", "swap", "freeze", "dropout"]
    at_s: Moment
    duration_s: Moment = 0.0
    body: Literal["leader", "follower", "both"] = "leader"
    offset: tuple[Coordinate, Coordinate] = (0.02, 0.0)
    angle: Angle = math.pi


class MocapSection(Section, frozen=True, kw_only=True):
    """The emulated motion capture: noise of a moving body, the share a standing one has, delivery.

    Its clock is ahead of the host's by ``clock_offset_s``, runs faster by ``clock_drift_ppm``, and jumps by
    ``clock_jump_s`` when the leader has been driving for ``clock_jump_at_s``.
    ``leader_mount``, ``follower_mount``: where the bodies really sit on the robots, as ``leader.mount`` says
    what is known of it.
    """

    rate_hz: Rate = 120.0
    sigma_position: Noise = 0.0003
    sigma_heading: Noise = 0.0035
    static_fraction: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.05
    latency_s: Span = 0.03
    jitter_s: Span = 0.0
    loss: Probability = 0.0
    clock_offset_s: Annotated[float, Meta(ge=-1.7e9, le=1e8)] = 0.0
    clock_drift_ppm: Annotated[float, Meta(ge=-500.0, le=500.0)] = 0.0
    clock_jump_s: Annotated[float, Meta(ge=-1e7, le=1e7)] = 0.0
    clock_jump_at_s: Moment = 0.0
    leader_mount: MountTriple = (0.0, 0.0, 0.0)
    follower_mount: MountTriple = (0.0, 0.0, 0.0)
    faults: tuple[FaultSection, ...] = ()
