"""The closed loop of a run in lockstep, compiled: emulator, estimator, prediction, law, guard, all in one.

It does what the nodes do on a simulated clock, event by event and to the nanosecond, without messages; a test
holds it to a lockstep run of the same seed. What it leaves out, :mod:`hil.sweep.engine_rules` refuses. The
names of the functions are those of the code that they stand for: ``_follow`` is ``Tracker.follow``,
``_capture`` is ``EmulatorNode._capture``, and so on.

All of it is in this one file, long as that makes it, because the cache of compiled code looks at the file of
a kernel only: what it called from elsewhere could change unnoticed.

Angles are carried as pairs (cos, sin) that are turned by small angles, so that hardly anything here calls a
trigonometric function. State is kept in records, which are handed on by reference and cost nothing to count.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import from_dtype, njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

Records = NDArray[np.void]
Record = Any
"""An element of :data:`Records` with named fields; writing to it writes to the array."""

_F = TypeVar("_F", bound=Callable[..., object])

EKF, UKF, DIFFERENCE = 0, 1, 2
INDEPENDENT, IDEAL, FEEDFORWARD, FADED = 0, 1, 2, 3
CONSTANT, SINUSOID, IMPULSE, TABLE = 0, 1, 2, 3
INITIALISING, TRACKING, COASTING, REJECTING, LOST = 0, 1, 2, 3, 4
DRIVING, STOPPED, NO_ESTIMATE, GIVEN_UP, NOT_SETTLED, STALE, NOT_FINITE = 0, 1, 2, 3, 4, 5, 6
SLOTS = 1024
"""Places for arcs: a power of two that does not divide 100 ms, as spans often differ by an actuator lag."""

_NS = 1e-9
_NEVER = 2**62
_ESTIMATOR_TICK_NS = 50_000_000
_REPORT_NS = 500_000_000
_SMALL = 0.125
_LARGEST = 1e6
_CLOCK_TOLERANCE = 0.05
_SAME_PLACE = 1e-3
_ROUNDING = 1e-9
_HAIR = 1e-6
_ROBOT_ARC, _PREDICTED_ARC = 0.01, 0.05
_FULL_NOISE_SPEED, _FULL_NOISE_TURN = 0.05, 0.2
_TRACK, _CANDIDATE, _PRIOR, _OTHER_PRIOR = 0, 1, 2, 3
_BELIEVED, _FOLLOWER, _FLIPPED, _SWAPPED, _FROZEN = 0, 1, 2, 3, 4
_SLIP = 0.1
_LEFT_OF_HEADING, _ERRORS_TOGETHER = 25.0 / 36.0, 1.5


def _fields(stamps: str, numbers: str) -> np.dtype[np.void]:
    """Record of integers, then floats, by their names."""
    fields = [(name, np.int64) for name in stamps.split()] + [(n, np.float64) for n in numbers.split()]
    return np.dtype(fields, align=True)


RULES = _fields(
    # Emulator, estimator, controller; times count from where the emulator begins.
    "patience_ns latency_ns duration_ns after_ns program "
    "kind reacquire_frames from_ns "
    "law tick_ns transport_ns ahead_ns max_age_ns",
    "lag v_max u_max v_resolution u_resolution sigma_position sigma_heading static_fraction "
    "odometry_sigma_v odometry_sigma_u loss p0 p1 p2 p3 "
    "q_v q_u q_start v_eps k_v k_u sd_position sd_heading sd_v2 sd_u2 gate coast_after lost_after "
    "settled_heading unsettled_heading capped_speed followed_turn doubt_for cutoff "
    "max_age assumed_lag mu1 mu2 mu_rho rho_0 v_limit u_limit v_step u_step spread",
)
"""All that is fixed in a run. p0 to p3: the fields of the leader's program in :mod:`formation.leader`."""

LOOP = _fields(
    "time_ns since_ns frames odometry pending commanded stopped estimator_well controller_well "
    "heard begun track_ns used_ns track_frame gated settled nursed nursed_frame doubt_ns estimator_tick_ns "
    "estimator_report_ns published_ns told "
    "status known capture_ns measured_ns first_sent sent controller_tick_ns controller_report_ns",
    "leader_u1 slow_u1 var_u1 nis doubt_position doubt_heading x y vx vy u1 v2 u2 owed_v owed_u",
)
"""All that changes besides robots and beliefs. The floats from x on: what the controller knows."""

ROBOT = _fields("", "x y heading cos sin v u goal_v goal_u")

BELIEF = _fields(
    "",
    "x y vx vy u x_x x_y y_y x_vx x_vy y_vx y_vy vx_vx vx_vy vy_vy x_u y_u vx_u vy_u u_u "
    "rho alpha2 rho_dot alpha2_dot heading samples elapsed",
)
"""Mean and covariance of the state of ``estimation.models.motion``, then what only differences remember."""

FRAME = _fields(
    "at_ns lost",
    "lx ly fx fy cos sin heading v2 u2 sd_v2 sd_u2 "
    "true_lx true_ly true_lheading true_fx true_fy true_fheading true_v1 true_u1 true_v2 true_u2",
)
"""A frame as seen, with the follower's odometry at its time, and the truth behind it."""

WATCH = _fields(
    "leader_frozen follower_frozen",
    "x y cos sin heading sd_position sd_heading shown_lx shown_ly shown_fx shown_fy shown_heading",
)
"""What the screen of frames knows: the follower's believed pose, carried on, and the newest frame."""

SAMPLE = _fields("at_ns", "v u")
TOLD = _fields("frame measured_ns now_ns status", "nis doubt_position doubt_heading x y cos sin")
SENT = _fields("at_ns reason", "v u")
ARC = _fields("span_ns pieces", "step decay share")
"""What a span of driving comes to: equal arcs, and how much of an offset from the goal decays over each."""


FRAME_NORMALS = _fields("", "lx ly lheading fx fy fheading")
SHARES = _fields("", "late lost")
ESTIMATE = _fields(
    "",
    "rho alpha2 rho_dot alpha2_dot v1 alpha1 u1 v2 u2 var_rho_dot var_alpha2_dot var_v1 var_alpha1 var_u1",
)
MOTION = _fields("", "v u")
TURN = _fields("", "t v u")
STATE = _fields("", "x y vx vy u")

RUN = np.dtype(
    [
        *(
            (name, np.int64)
            for name in (
                *("frame_normals", "frame_shares", "odometry_normals", "table", "table_rows"),
                *("beliefs", "columns", "points", "driven", "predicted"),
                *("frames", "samples", "told", "kept", "sent"),
            )
        ),
        ("rules", RULES),
        ("loop", LOOP),
        ("leader", ROBOT),
        ("follower", ROBOT),
        ("watch", WATCH),
        ("expected", WATCH),
        ("pose", _fields("", "x y cos sin")),
        ("noise", _fields("", "position heading v2 u2")),
        ("here", ESTIMATE),
    ],
    align=True,
)
"""All memory of a run. The integers are addresses of arrays: counting references to them would take longer
than the arithmetic. What is given: random numbers, rows t, v, u of the leader's program if it is a table.
What is worked in: four beliefs, sigma points and the columns of a root, arcs of :func:`_arcs`. What is left
behind: frames, odometry, estimates with the beliefs behind them (``kept``), commands. ``pose``, ``noise``,
``here`` are what the judge's kernels work in.
"""


def _element(dtype: np.dtype[np.void]) -> Callable[[int, int], Record]:
    """Function that takes the address of an array of this type and an index, and gives the element."""
    record = from_dtype(dtype)
    size = dtype.itemsize

    def element(typing_context: object, address: object, index: object) -> tuple[Any, Callable[..., Any]]:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            base, number = arguments
            offset = builder.mul(number, context.get_constant(types.int64, size))
            return builder.inttoptr(builder.add(base, offset), context.get_value_type(record))

        return record(types.int64, types.int64), code

    made: Any = intrinsic(element)
    found: Callable[[int, int], Record] = made
    return found


_frame = _element(FRAME)
_sample = _element(SAMPLE)
_told = _element(TOLD)
_belief = _element(BELIEF)
_sent = _element(SENT)
_arc = _element(ARC)
_frame_normals = _element(FRAME_NORMALS)
_shares = _element(SHARES)
_motion = _element(MOTION)
_turn = _element(TURN)
_state = _element(STATE)
_estimate = _element(ESTIMATE)


def _compiled(*signature: object) -> Callable[[_F], _F]:
    """Compile for one signature now, or without one for whatever a kernel calls the function with."""
    compiler: Any = njit(
        signature or None,
        cache=True,
        nogil=True,
        fastmath=False,
        error_model="numpy",
        forceinline=not signature,
    )
    decorate: Callable[[_F], _F] = compiler
    return decorate


# Angles and arcs


@_compiled()
def _small_turn(x: float) -> tuple[float, float]:
    """sin(x)/x and cos(x); series that are exact to rounding where they are used."""
    if abs(x) > _SMALL:
        return math.sin(x) / x, math.cos(x)
    q = x * x
    sinc = 1.0 - q * (1 / 6) * (1.0 - q * (1 / 20) * (1.0 - q * (1 / 42) * (1.0 - q * (1 / 72))))
    versed = q * 0.5 * (1.0 - q * (1 / 12) * (1.0 - q * (1 / 30) * (1.0 - q * (1 / 56))))
    return sinc, 1.0 - versed


@_compiled()
def _wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@_compiled()
def _arcs(arcs: int, span_ns: int, lag: float, longest: float, rounding: float) -> Record:
    """Arcs of a span, looked up: few different spans come up in a run."""
    arc = _arc(arcs, span_ns & (SLOTS - 1))
    if arc.span_ns != span_ns:
        span = span_ns * _NS
        arc.span_ns = span_ns
        arc.pieces = max(1, math.ceil(span / longest - rounding))
        arc.step = span / arc.pieces
        arc.decay = math.exp(-arc.step / lag) if lag > 0.0 else 0.0
        arc.share = (1.0 - arc.decay) * lag / arc.step
    return arc


@_compiled()
def _advance(
    x: float, y: float, cos: float, sin: float, v: float, u: float, dt: float
) -> tuple[float, float, float, float]:
    """Position and direction after an arc."""
    half = 0.5 * u * dt
    sinc, c = _small_turn(half)
    s, chord = half * sinc, v * dt * sinc
    mid_cos, mid_sin = cos * c - sin * s, sin * c + cos * s
    end_cos, end_sin = mid_cos * c - mid_sin * s, mid_sin * c + mid_cos * s
    return x + chord * mid_cos, y + chord * mid_sin, end_cos, end_sin


# The emulated lab


@_compiled()
def _drive(robot: Record, arc: Record) -> None:
    for _ in range(arc.pieces):
        v_off, u_off = robot.v - robot.goal_v, robot.u - robot.goal_u
        v, u = robot.goal_v + v_off * arc.share, robot.goal_u + u_off * arc.share
        x, y, c, s = _advance(robot.x, robot.y, robot.cos, robot.sin, v, u, arc.step)
        robot.x, robot.y, robot.cos, robot.sin = x, y, c, s
        robot.heading += u * arc.step
        robot.v, robot.u = robot.goal_v + v_off * arc.decay, robot.goal_u + u_off * arc.decay


@_compiled()
def _move(run: Record, until_ns: int) -> None:
    loop = run.loop
    if until_ns <= loop.time_ns:
        return
    arc = _arcs(run.driven, until_ns - loop.time_ns, run.rules.lag, _ROBOT_ARC, _ROUNDING)
    _drive(run.leader, arc)
    _drive(run.follower, arc)
    loop.time_ns = until_ns


@_compiled()
def _truncate(value: float, resolution: float) -> float:
    if resolution <= 0.0:
        return value
    return math.trunc(value / resolution + math.copysign(_ROUNDING, value)) * resolution


@_compiled()
def _tell(robot: Record, rules: Record, v: float, u: float) -> None:
    robot.goal_v = _truncate(max(-rules.v_max, min(rules.v_max, v)), rules.v_resolution)
    robot.goal_u = _truncate(max(-rules.u_max, min(rules.u_max, u)), rules.u_resolution)


@_compiled()
def _interpolated(table: int, rows: int, t: float) -> tuple[float, float]:
    after = 0
    while after < rows and _turn(table, after).t <= t:
        after += 1
    last = _turn(table, min(after, rows - 1))
    if after == 0 or after == rows:
        return last.v, last.u
    first = _turn(table, after - 1)
    share = (t - first.t) / (last.t - first.t)
    return (1.0 - share) * first.v + share * last.v, (1.0 - share) * first.u + share * last.u


@_compiled()
def _program(run: Record, t: float) -> tuple[float, float]:
    """Speed and turn rate that the leader is to drive at a time."""
    rules = run.rules
    if rules.program == SINUSOID:
        return rules.p0, rules.p1 + rules.p2 * math.sin(rules.p3 * t)
    if rules.program == IMPULSE:
        widths = (t - rules.p2) / rules.p3
        return rules.p0, rules.p1 * math.exp(-0.5 * widths * widths)
    if rules.program == CONSTANT:
        return rules.p0, rules.p1
    return _interpolated(run.table, run.table_rows, t)


@_compiled()
def _lead(run: Record, at_ns: int) -> None:
    loop = run.loop
    if loop.stopped:
        return
    if loop.since_ns < 0:
        if not (loop.commanded and loop.estimator_well and loop.controller_well):
            return
        loop.since_ns = at_ns
    v, u = _program(run, (at_ns - loop.since_ns) * _NS)
    _tell(run.leader, run.rules, v, u)


@_compiled()
def _noise(robot: Record, static_fraction: float) -> float:
    v, u = robot.v / _FULL_NOISE_SPEED, robot.u / _FULL_NOISE_TURN
    return static_fraction + (1.0 - static_fraction) * min(1.0, math.sqrt(v * v + u * u))


@_compiled()
def _observe(frame: Record, leader: Record, follower: Record, rules: Record, normal: Record) -> None:
    scale = _noise(leader, rules.static_fraction) * rules.sigma_position
    frame.lx, frame.ly = leader.x + scale * normal.lx, leader.y + scale * normal.ly
    activity = _noise(follower, rules.static_fraction)
    scale = activity * rules.sigma_position
    frame.fx, frame.fy = follower.x + scale * normal.fx, follower.y + scale * normal.fy
    error = activity * rules.sigma_heading * normal.fheading
    sinc, c = _small_turn(error)
    s = error * sinc
    frame.cos, frame.sin = follower.cos * c - follower.sin * s, follower.sin * c + follower.cos * s
    frame.heading = follower.heading + error


@_compiled()
def _capture(
    frame: Record, leader: Record, follower: Record, rules: Record, normal: Record, share: float
) -> None:
    frame.true_lx, frame.true_ly, frame.true_lheading = leader.x, leader.y, leader.heading
    frame.true_fx, frame.true_fy, frame.true_fheading = follower.x, follower.y, follower.heading
    frame.true_v1, frame.true_u1, frame.true_v2, frame.true_u2 = leader.v, leader.u, follower.v, follower.u
    frame.lost = share < rules.loss
    if not frame.lost:
        _observe(frame, leader, follower, rules, normal)


@_compiled()
def _sample_odometry(sample: Record, follower: Record, rules: Record, normal: Record) -> None:
    moving = 0.0 if follower.v == 0.0 and follower.u == 0.0 else 1.0
    sample.v = follower.v + moving * rules.odometry_sigma_v * normal.v
    sample.u = follower.u + moving * rules.odometry_sigma_u * normal.u


@_compiled()
def _release_ns(loop: Record, frames: int, latency_ns: int) -> int:
    """When the next frame on its way arrives; frames take equally long, and so arrive in order."""
    while loop.pending < loop.frames and _frame(frames, loop.pending).lost:
        loop.pending += 1
    return _frame(frames, loop.pending).at_ns + latency_ns if loop.pending < loop.frames else _NEVER


# The filters


@_compiled()
def _range_and_bearing(frame: Record) -> tuple[float, float]:
    dx, dy = frame.lx - frame.fx, frame.ly - frame.fy
    ahead, left = frame.cos * dx + frame.sin * dy, frame.cos * dy - frame.sin * dx
    return math.sqrt(dx * dx + dy * dy), math.atan2(left, ahead)


@_compiled()
def _clear(b: Record) -> None:
    b.x = b.y = b.vx = b.vy = b.u = 0.0
    b.x_x = b.x_y = b.y_y = b.x_vx = b.x_vy = b.y_vx = b.y_vy = 0.0
    b.vx_vx = b.vx_vy = b.vy_vy = b.x_u = b.y_u = b.vx_u = b.vy_u = b.u_u = 0.0
    b.rho = b.alpha2 = b.rho_dot = b.alpha2_dot = b.heading = b.samples = b.elapsed = 0.0


@_compiled()
def _start(b: Record, rules: Record, frame: Record) -> None:
    """Belief from the first measurement alone."""
    _clear(b)
    b.x, b.y = frame.lx, frame.ly
    b.x_x = b.y_y = rules.sd_position * rules.sd_position
    b.vx_vx = b.vy_vy = rules.k_v * rules.k_v
    b.u_u = rules.k_u * rules.k_u
    if rules.kind == DIFFERENCE:
        b.rho, b.alpha2 = _range_and_bearing(frame)


@_compiled()
def _add_noise(b: Record, wx: float, wy: float, dt: float, rules: Record) -> None:
    """Add the noise of the leader's motion, (wx, wy) being its velocity before the step."""
    squared, floor = wx * wx + wy * wy, rules.v_eps * rules.v_eps
    weight = rules.q_v / (squared + floor)
    start = rules.q_start * max(0.0, 1.0 - squared / floor)
    xx, xy, yy = weight * (wx * wx + floor) + start, weight * wx * wy, weight * (wy * wy + floor) + start
    twice = 0.5 * dt * dt
    thrice = dt * dt * dt / 3.0
    b.x_x += thrice * xx
    b.x_y += thrice * xy
    b.y_y += thrice * yy
    b.x_vx += twice * xx
    b.x_vy += twice * xy
    b.y_vx += twice * xy
    b.y_vy += twice * yy
    b.vx_vx += dt * xx
    b.vx_vy += dt * xy
    b.vy_vy += dt * yy
    b.u_u += rules.q_u * dt


@_compiled()
def _swing(u: float, dt: float) -> tuple[float, float, float, float, float, float]:
    """Cosine and sine of a turn u dt, the integrals of both over dt, and these by u."""
    a = u * dt
    sinc, cos_a = _small_turn(a)
    half, _ = _small_turn(0.5 * a)
    s, c = dt * sinc, 0.5 * dt * a * half * half
    if abs(a) > _SMALL:
        return cos_a, a * sinc, s, c, (dt * cos_a - s) / u, (dt * a * sinc - c) / u
    q = a * a
    ds = -dt * dt * a * (1 / 3) * (1.0 - q * (1 / 10) * (1.0 - q * (1 / 28) * (1.0 - q * (1 / 54))))
    dc = dt * dt * (0.5 - q * (1 / 8) * (1.0 - q * (1 / 18) * (1.0 - q * (1 / 40))))
    return cos_a, a * sinc, s, c, ds, dc


@_compiled()
def _extended_predict(a: Record, b: Record, dt: float, rules: Record) -> None:
    """Carry belief a through dt by linearisation into b: F P F' + Q by its blocks."""
    wx, wy, u = a.vx, a.vy, a.u
    co, si, s, c, ds, dc = _swing(u, dt)
    vx, vy = co * wx - si * wy, si * wx + co * wy
    # Derivatives of the moved position and velocity by the turn rate.
    xu, yu, vxu, vyu = ds * wx - dc * wy, dc * wx + ds * wy, -dt * vy, dt * vx
    # Covariances of the moved quantities, marked m, with those before.
    mx_u, my_u = a.x_u + s * a.vx_u - c * a.vy_u + xu * a.u_u, a.y_u + c * a.vx_u + s * a.vy_u + yu * a.u_u
    mvx_u, mvy_u = co * a.vx_u - si * a.vy_u + vxu * a.u_u, si * a.vx_u + co * a.vy_u + vyu * a.u_u
    mx_vx = a.x_vx + s * a.vx_vx - c * a.vx_vy + xu * a.vx_u
    mx_vy = a.x_vy + s * a.vx_vy - c * a.vy_vy + xu * a.vy_u
    my_vx = a.y_vx + c * a.vx_vx + s * a.vx_vy + yu * a.vx_u
    my_vy = a.y_vy + c * a.vx_vy + s * a.vy_vy + yu * a.vy_u
    mvx_vx = co * a.vx_vx - si * a.vx_vy + vxu * a.vx_u
    mvx_vy = co * a.vx_vy - si * a.vy_vy + vxu * a.vy_u
    mvy_vx = si * a.vx_vx + co * a.vx_vy + vyu * a.vx_u
    mvy_vy = si * a.vx_vy + co * a.vy_vy + vyu * a.vy_u
    mx_x = a.x_x + s * a.x_vx - c * a.x_vy + xu * a.x_u
    mx_y = a.x_y + s * a.y_vx - c * a.y_vy + xu * a.y_u
    my_y = a.y_y + c * a.y_vx + s * a.y_vy + yu * a.y_u
    b.x, b.y, b.vx, b.vy, b.u = a.x + s * wx - c * wy, a.y + c * wx + s * wy, vx, vy, u
    b.x_x = mx_x + s * mx_vx - c * mx_vy + xu * mx_u
    b.x_y = mx_y + c * mx_vx + s * mx_vy + yu * mx_u
    b.y_y = my_y + c * my_vx + s * my_vy + yu * my_u
    b.x_vx, b.x_vy = co * mx_vx - si * mx_vy + vxu * mx_u, si * mx_vx + co * mx_vy + vyu * mx_u
    b.y_vx, b.y_vy = co * my_vx - si * my_vy + vxu * my_u, si * my_vx + co * my_vy + vyu * my_u
    b.vx_vx = co * mvx_vx - si * mvx_vy + vxu * mvx_u
    b.vx_vy = si * mvx_vx + co * mvx_vy + vyu * mvx_u
    b.vy_vy = si * mvy_vx + co * mvy_vy + vyu * mvy_u
    b.x_u, b.y_u, b.vx_u, b.vy_u, b.u_u = mx_u, my_u, mvx_u, mvy_u, a.u_u
    _add_noise(b, wx, wy, dt, rules)


@_compiled()
def _pivot(variance: float) -> tuple[float, float]:
    """Root of a pivot and its inverse; both zero for one that is not positive, even if by rounding."""
    if variance <= 0.0:
        return 0.0, 0.0
    root = math.sqrt(variance)
    return root, 1.0 / root


@_compiled()
def _scaled_root(a: Record, columns: int) -> None:
    """Columns of the lower triangular root of five times a covariance, as in ``filters.kernels``."""
    p, q, r = _state(columns, 0), _state(columns, 1), _state(columns, 2)
    s, t = _state(columns, 3), _state(columns, 4)
    p.x, scale = _pivot(5.0 * a.x_x)
    p.y, p.vx, p.vy = 5.0 * a.x_y * scale, 5.0 * a.x_vx * scale, 5.0 * a.x_vy * scale
    p.u = 5.0 * a.x_u * scale
    q.y, scale = _pivot(5.0 * a.y_y - p.y * p.y)
    q.vx, q.vy = (5.0 * a.y_vx - p.vx * p.y) * scale, (5.0 * a.y_vy - p.vy * p.y) * scale
    q.u = (5.0 * a.y_u - p.u * p.y) * scale
    r.vx, scale = _pivot(5.0 * a.vx_vx - p.vx * p.vx - q.vx * q.vx)
    r.vy = (5.0 * a.vx_vy - p.vy * p.vx - q.vy * q.vx) * scale
    r.u = (5.0 * a.vx_u - p.u * p.vx - q.u * q.vx) * scale
    s.vy, scale = _pivot(5.0 * a.vy_vy - p.vy * p.vy - q.vy * q.vy - r.vy * r.vy)
    s.u = (5.0 * a.vy_u - p.u * p.vy - q.u * q.vy - r.u * r.vy) * scale
    t.u, _ = _pivot(5.0 * a.u_u - p.u * p.u - q.u * q.u - r.u * r.u - s.u * s.u)


@_compiled()
def _unscented_predict(a: Record, b: Record, dt: float, run: Record) -> None:
    """Carry belief a through dt into b by ten points (cubature rule)."""
    _scaled_root(a, run.columns)
    _clear(b)
    for row in range(10):
        sign = 1.0 if row < 5 else -1.0
        column, point = _state(run.columns, row % 5), _state(run.points, row)
        wx, wy, u = a.vx + sign * column.vx, a.vy + sign * column.vy, a.u + sign * column.u
        co, si, s, c, _, _ = _swing(u, dt)
        point.x = a.x + sign * column.x + s * wx - c * wy
        point.y = a.y + sign * column.y + c * wx + s * wy
        point.vx, point.vy, point.u = co * wx - si * wy, si * wx + co * wy, u
        b.x, b.y, b.u = b.x + 0.1 * point.x, b.y + 0.1 * point.y, b.u + 0.1 * u
        b.vx, b.vy = b.vx + 0.1 * point.vx, b.vy + 0.1 * point.vy
    for row in range(10):
        _add_point(b, _state(run.points, row))
    _add_noise(b, a.vx, a.vy, dt, run.rules)


@_compiled()
def _add_point(b: Record, point: Record) -> None:
    x, y, vx, vy, u = point.x - b.x, point.y - b.y, point.vx - b.vx, point.vy - b.vy, point.u - b.u
    b.x_x += 0.1 * x * x
    b.x_y += 0.1 * x * y
    b.y_y += 0.1 * y * y
    b.x_vx += 0.1 * x * vx
    b.x_vy += 0.1 * x * vy
    b.y_vx += 0.1 * y * vx
    b.y_vy += 0.1 * y * vy
    b.vx_vx += 0.1 * vx * vx
    b.vx_vy += 0.1 * vx * vy
    b.vy_vy += 0.1 * vy * vy
    b.x_u += 0.1 * x * u
    b.y_u += 0.1 * y * u
    b.vx_u += 0.1 * vx * u
    b.vy_u += 0.1 * vy * u
    b.u_u += 0.1 * u * u


@_compiled()
def _predict(a: Record, b: Record, dt: float, run: Record) -> None:
    rules = run.rules
    if rules.kind == UKF:
        _unscented_predict(a, b, dt, run)
        return
    _extended_predict(a, b, dt, rules)
    if rules.kind == DIFFERENCE:
        b.rho, b.alpha2, b.rho_dot, b.alpha2_dot = a.rho, a.alpha2, a.rho_dot, a.alpha2_dot
        b.heading, b.samples, b.elapsed = a.heading, a.samples, a.elapsed + dt


@_compiled()
def _nis(b: Record, rules: Record, frame: Record) -> float:
    spread = rules.sd_position * rules.sd_position
    x, y = frame.lx - b.x, frame.ly - b.y
    p, q, r = b.x_x + spread, b.x_y, b.y_y + spread
    return float((r * x * x - 2.0 * q * x * y + p * y * y) / (p * r - q * q))


@_compiled()
def _inform(a: Record, b: Record, spread: float, zx: float, zy: float) -> None:
    """Take in that the leader was seen at (zx, zy) with covariance spread I; belief a becomes b."""
    p, q, r = a.x_x + spread, a.x_y, a.y_y + spread
    det = p * r - q * q
    xx, xy, yy = r / det, -q / det, p / det
    x, y = zx - a.x, zy - a.y
    hx, hy = xx * x + xy * y, xy * x + yy * y
    b.x, b.y = a.x + a.x_x * hx + a.x_y * hy, a.y + a.x_y * hx + a.y_y * hy
    b.vx, b.vy = a.vx + a.x_vx * hx + a.y_vx * hy, a.vy + a.x_vy * hx + a.y_vy * hy
    b.u = a.u + a.x_u * hx + a.y_u * hy
    # The inverse of the innovation's covariance times that of the position with velocity and turn rate.
    kx_vx, kx_vy = xx * a.x_vx + xy * a.y_vx, xx * a.x_vy + xy * a.y_vy
    ky_vx, ky_vy = xy * a.x_vx + yy * a.y_vx, xy * a.x_vy + yy * a.y_vy
    kx_u, ky_u = xx * a.x_u + xy * a.y_u, xy * a.x_u + yy * a.y_u
    b.vx_vx = a.vx_vx - a.x_vx * kx_vx - a.y_vx * ky_vx
    b.vx_vy = a.vx_vy - a.x_vx * kx_vy - a.y_vx * ky_vy
    b.vy_vy = a.vy_vy - a.x_vy * kx_vy - a.y_vy * ky_vy
    b.vx_u = a.vx_u - a.x_vx * kx_u - a.y_vx * ky_u
    b.vy_u = a.vy_u - a.x_vy * kx_u - a.y_vy * ky_u
    b.u_u = a.u_u - a.x_u * kx_u - a.y_u * ky_u
    b.x_x, b.x_y, b.y_y = (
        spread * (a.x_x * xx + a.x_y * xy),
        spread * (a.x_x * xy + a.x_y * yy),
        spread * (a.x_y * xy + a.y_y * yy),
    )
    b.x_vx, b.x_vy, b.y_vx, b.y_vy = spread * kx_vx, spread * kx_vy, spread * ky_vx, spread * ky_vy
    b.x_u, b.y_u = spread * kx_u, spread * ky_u


@_compiled()
def _difference(a: Record, b: Record, rules: Record, frame: Record) -> None:
    """``DifferenceEstimator.update``: difference the measurement against the last one, and smooth."""
    dt, samples = a.elapsed, a.samples
    rho, alpha2 = _range_and_bearing(frame)
    gain = max(dt / (rules.cutoff + dt), 1.0 / (samples + 1.0))
    rho_dot = a.rho_dot + gain * ((rho - a.rho) / dt - a.rho_dot)
    alpha2_dot = a.alpha2_dot + gain * (_wrap(alpha2 - a.alpha2) / dt - a.alpha2_dot)
    x = -rho_dot - frame.v2 * math.cos(alpha2)
    y = rho * (alpha2_dot + frame.u2) - frame.v2 * math.sin(alpha2)
    v1 = math.sqrt(x * x + y * y)
    heading = alpha2 + frame.heading + math.pi - math.atan2(y, x)
    u1 = a.u + gain * (_wrap(heading - a.heading) / dt - a.u) if samples > 0.0 else 0.0
    _clear(b)
    b.x, b.y, b.vx, b.vy, b.u = frame.lx, frame.ly, v1 * math.cos(heading), v1 * math.sin(heading), u1
    b.rho, b.alpha2, b.rho_dot, b.alpha2_dot, b.heading = rho, alpha2, rho_dot, alpha2_dot, heading
    b.samples = samples + 1.0
    _difference_spread(b, rules, frame, gain / dt, gain, v1)


@_compiled()
def _difference_spread(b: Record, rules: Record, frame: Record, ratio: float, gain: float, v1: float) -> None:
    smoothed = ratio * ratio * 2.0 / (2.0 - gain)
    spread = rules.sd_position * rules.sd_position
    c, s = frame.cos, frame.sin
    nx, ny = frame.fy - frame.ly, frame.lx - frame.fx
    slow = max(v1, rules.v_eps)
    lag = rules.cutoff * rules.k_u * slow
    even = smoothed * 2.0 * spread + lag * lag
    across = smoothed * rules.sd_heading * rules.sd_heading + frame.sd_u2 * frame.sd_u2
    ahead = frame.sd_v2 * frame.sd_v2
    b.x_x = b.y_y = spread
    b.x_vx = b.y_vy = ratio * spread
    b.vx_vx = even + across * nx * nx + ahead * c * c
    b.vx_vy = across * nx * ny + ahead * c * s
    b.vy_vy = even + across * ny * ny + ahead * s * s
    b.u_u = min(0.5 * (b.vx_vx + b.vy_vy) / (slow * slow) * smoothed, rules.k_u * rules.k_u)


@_compiled()
def _copy(a: Record, b: Record) -> None:
    b.x, b.y, b.vx, b.vy, b.u = a.x, a.y, a.vx, a.vy, a.u
    b.x_x, b.x_y, b.y_y, b.x_vx, b.x_vy, b.y_vx, b.y_vy = a.x_x, a.x_y, a.y_y, a.x_vx, a.x_vy, a.y_vx, a.y_vy
    b.vx_vx, b.vx_vy, b.vy_vy = a.vx_vx, a.vx_vy, a.vy_vy
    b.x_u, b.y_u, b.vx_u, b.vy_u, b.u_u = a.x_u, a.y_u, a.vx_u, a.vy_u, a.u_u
    b.rho, b.alpha2, b.rho_dot, b.alpha2_dot = a.rho, a.alpha2, a.rho_dot, a.alpha2_dot
    b.heading, b.samples, b.elapsed = a.heading, a.samples, a.elapsed


@_compiled()
def _update(a: Record, b: Record, rules: Record, frame: Record) -> None:
    if rules.kind != DIFFERENCE:
        _inform(a, b, rules.sd_position * rules.sd_position, frame.lx, frame.ly)
    elif a.elapsed > 0.0:
        _difference(a, b, rules, frame)
    else:
        _copy(a, b)


# The estimator node


@_compiled()
def _settled(b: Record, rules: Record, before: int) -> bool:
    squared = b.vx * b.vx + b.vy * b.vy
    if squared < 0.25 * rules.v_eps * rules.v_eps:
        return False
    half = 0.5 * (b.vx_vx - b.vy_vy)
    largest = max(0.0, 0.5 * (b.vx_vx + b.vy_vy) + math.sqrt(half * half + b.vx_vy * b.vx_vy))
    if before:
        return bool(largest < rules.unsettled_heading * rules.unsettled_heading * squared)
    helpful = min(squared, rules.k_v * rules.k_v) if rules.capped_speed else squared
    return bool(largest < rules.settled_heading * rules.settled_heading * helpful)


@_compiled()
def _watch_from(watch: Record, frame: Record) -> None:
    watch.x, watch.y, watch.heading = frame.fx, frame.fy, frame.heading
    watch.cos, watch.sin = frame.cos, frame.sin
    watch.sd_position = watch.sd_heading = 0.0
    watch.leader_frozen = watch.follower_frozen = 0
    _show(watch, frame)


@_compiled()
def _show(watch: Record, frame: Record) -> None:
    watch.shown_lx, watch.shown_ly = frame.lx, frame.ly
    watch.shown_fx, watch.shown_fy, watch.shown_heading = frame.fx, frame.fy, frame.heading


@_compiled()
def _carry(watch: Record, before: Record, after: Record) -> None:
    """Move a watch on by the follower's own motion, as measured at two frames."""
    dt = (after.at_ns - before.at_ns) * _NS
    v, u = 0.5 * (before.v2 + after.v2), 0.5 * (before.u2 + after.u2)
    sd_v = max(before.sd_v2, after.sd_v2) + _SLIP * abs(v) + 0.5 * abs(after.v2 - before.v2)
    sd_u = max(before.sd_u2, after.sd_u2) + _SLIP * abs(u) + 0.5 * abs(after.u2 - before.u2)
    watch.sd_heading += sd_u * dt
    watch.sd_position += (sd_v + abs(v) * watch.sd_heading) * dt
    watch.x, watch.y, watch.cos, watch.sin = _advance(watch.x, watch.y, watch.cos, watch.sin, v, u, dt)
    watch.heading += u * dt


@_compiled()
def _position_misfit(watch: Record, x: float, y: float, rules: Record) -> float:
    dx, dy = x - watch.x, y - watch.y
    spread = 2.0 * rules.sd_position * rules.sd_position + watch.sd_position * watch.sd_position
    return float((dx * dx + dy * dy) / spread)


@_compiled()
def _heading_misfit(watch: Record, turned: float, rules: Record) -> float:
    off = _wrap(turned)
    spread = 2.0 * rules.sd_heading * rules.sd_heading + watch.sd_heading * watch.sd_heading
    return float(off * off / spread)


@_compiled()
def _misfit(watch: Record, frame: Record, rules: Record) -> float:
    return max(
        _position_misfit(watch, frame.fx, frame.fy, rules),
        _heading_misfit(watch, frame.heading - watch.heading, rules),
    )


@_compiled()
def _look_at(watch: Record, frame: Record, gate: float, off: float, leader_moves: bool) -> None:
    """Take a frame in whose follower is ``off``; only a pose within the gate that brings news is believed."""
    leader_repeats = frame.lx == watch.shown_lx and frame.ly == watch.shown_ly
    repeats = (
        frame.fx == watch.shown_fx and frame.fy == watch.shown_fy and frame.heading == watch.shown_heading
    )
    leader_frozen = leader_repeats and (watch.leader_frozen != 0 or leader_moves)
    follower_frozen = repeats and (watch.follower_frozen != 0 or off > gate)
    if not repeats and not off > gate:
        _watch_from(watch, frame)
    watch.leader_frozen, watch.follower_frozen = leader_frozen, follower_frozen
    _show(watch, frame)


@_compiled()
def _cause_of(watch: Record, frame: Record, rules: Record, off: float) -> int:
    """What there is against a frame that the watch has taken in."""
    if watch.leader_frozen or watch.follower_frozen:
        return _FROZEN
    if off <= rules.gate:
        return _BELIEVED
    if _position_misfit(watch, frame.lx, frame.ly, rules) <= rules.gate:
        return _SWAPPED
    turned_round = _heading_misfit(watch, frame.heading - watch.heading + math.pi, rules) <= rules.gate
    in_place = _position_misfit(watch, frame.fx, frame.fy, rules) <= rules.gate
    return _FLIPPED if turned_round and in_place else _FOLLOWER


@_compiled()
def _screened(run: Record, frame: Record) -> int:
    """Cause against a frame; the watch moves on to it."""
    rules, watch, track = run.rules, run.watch, _belief(run.beliefs, _TRACK)
    _carry(watch, _frame(run.frames, run.loop.track_frame), frame)
    off = _misfit(watch, frame, rules)
    speed = math.sqrt(track.vx * track.vx + track.vy * track.vy)
    _look_at(watch, frame, rules.gate, off, speed >= 0.5 * rules.v_eps)
    return _cause_of(watch, frame, rules, off)


@_compiled()
def _begin(run: Record, frame: Record) -> None:
    """First point of a track that knows nothing but this measurement."""
    loop = run.loop
    _start(_belief(run.beliefs, _TRACK), run.rules, frame)
    _watch_from(run.watch, frame)
    loop.begun, loop.gated, loop.settled, loop.nursed = 1, 0, 0, 0
    loop.doubt_position = loop.doubt_heading = 0.0
    loop.used_ns, loop.nis = frame.at_ns, math.nan


@_compiled()
def _follower_fits(run: Record, frame: Record) -> bool:
    """Whether the follower is where the candidate's last frame and its own motion have it."""
    last = _frame(run.frames, run.loop.nursed_frame)
    _watch_from(run.expected, last)
    _carry(run.expected, last, frame)
    return bool(_misfit(run.expected, frame, run.rules) <= run.rules.gate)


@_compiled()
def _nurse(run: Record, frame: Record, number: int) -> None:
    """Let a rejected measurement join the candidate, or start a new one if they do not agree."""
    loop, rules = run.loop, run.rules
    candidate, prior = _belief(run.beliefs, _CANDIDATE), _belief(run.beliefs, _OTHER_PRIOR)
    if loop.nursed > 0:
        _predict(candidate, prior, (frame.at_ns - _frame(run.frames, loop.nursed_frame).at_ns) * _NS, run)
        if _nis(prior, rules, frame) <= rules.gate and _follower_fits(run, frame):
            _update(prior, candidate, rules, frame)
            loop.nursed += 1
            loop.nursed_frame = number
            return
    _start(candidate, rules, frame)
    loop.nursed, loop.nursed_frame = 1, number


@_compiled()
def _find(run: Record, frame: Record, number: int) -> None:
    """Start anew after a loss: with the candidate if it is ripe, unless the frame is plainly wrong."""
    loop, rules = run.loop, run.rules
    cause = _screened(run, frame)
    if cause != _BELIEVED and cause != _FOLLOWER:
        loop.gated, loop.settled, loop.nursed, loop.nis = 1, 0, 0, math.nan
        return
    _nurse(run, frame, number)
    ripe = loop.nursed >= rules.reacquire_frames
    _begin(run, frame)
    if ripe:
        track = _belief(run.beliefs, _TRACK)
        _copy(_belief(run.beliefs, _CANDIDATE), track)
        loop.settled = _settled(track, rules, 0)


@_compiled()
def _follow(run: Record, frame: Record, number: int) -> None:
    """Fold one measurement into the track."""
    loop, rules = run.loop, run.rules
    if not loop.begun:
        _begin(run, frame)
        return
    if (frame.at_ns - loop.used_ns) * _NS > rules.lost_after:
        _find(run, frame, number)
        return
    track, prior = _belief(run.beliefs, _TRACK), _belief(run.beliefs, _PRIOR)
    cause = _screened(run, frame)
    _predict(track, prior, (frame.at_ns - loop.track_ns) * _NS, run)
    loop.nis = _nis(prior, rules, frame)
    if (frame.at_ns - loop.doubt_ns) * _NS > rules.doubt_for:
        loop.doubt_position = loop.doubt_heading = 0.0
    if cause == _BELIEVED and loop.nis <= rules.gate:
        _update(prior, track, rules, frame)
        loop.settled = _settled(track, rules, loop.settled)
        loop.used_ns, loop.gated, loop.nursed = frame.at_ns, 0, 0
        return
    _copy(prior, track)
    loop.settled = _settled(track, rules, loop.settled)
    loop.gated = 1
    if cause == _FROZEN:
        loop.nursed = 0
        return
    _nurse(run, frame, number)
    if loop.nursed >= rules.reacquire_frames:
        _take_over(run, frame)


@_compiled()
def _take_over(run: Record, frame: Record) -> None:
    """Let the candidate take over, in doubt by its jump, unless it goes too far."""
    loop, rules, watch = run.loop, run.rules, run.watch
    track, prior = _belief(run.beliefs, _TRACK), _belief(run.beliefs, _PRIOR)
    fits = loop.nis <= rules.gate
    position, heading = loop.doubt_position, loop.doubt_heading
    if not fits:
        position += math.hypot(frame.lx - prior.x, frame.ly - prior.y)
    position += math.hypot(frame.fx - watch.x, frame.fy - watch.y)
    heading += abs(_wrap(frame.heading - watch.heading))
    rho = math.hypot(frame.lx - frame.fx, frame.ly - frame.fy)
    if heading + (position / rho if rho > 0.0 else math.inf) > rules.followed_turn:
        return
    if fits:
        _update(prior, track, rules, frame)
    else:
        _copy(_belief(run.beliefs, _CANDIDATE), track)
    loop.settled = _settled(track, rules, loop.settled if fits else 0)
    loop.doubt_position, loop.doubt_heading, loop.doubt_ns = position, heading, frame.at_ns
    loop.used_ns, loop.gated, loop.nursed = frame.at_ns, 0, 0
    _watch_from(watch, frame)


@_compiled()
def _own_motion(frame: Record, samples: int, heard: int, rules: Record) -> None:
    """The follower's motion at a capture: linear between the samples of odometry that are there."""
    frame.sd_v2, frame.sd_u2 = rules.sd_v2, rules.sd_u2
    if heard == 0:
        frame.v2, frame.u2 = 0.0, 0.0
        frame.sd_v2, frame.sd_u2 = max(rules.sd_v2, rules.v_limit), max(rules.sd_u2, rules.u_limit)
        return
    after = heard
    while after > 0 and _sample(samples, after - 1).at_ns >= frame.at_ns:
        after -= 1
    last = _sample(samples, min(after, heard - 1))
    if after == heard or after == 0:
        frame.v2, frame.u2 = last.v, last.u
        return
    first = _sample(samples, after - 1)
    share = (frame.at_ns - first.at_ns) / (last.at_ns - first.at_ns)
    frame.v2, frame.u2 = first.v + share * (last.v - first.v), first.u + share * (last.u - first.u)


@_compiled()
def _status(loop: Record, rules: Record, now_ns: int) -> int:
    if not loop.begun:
        return INITIALISING
    silence = (now_ns - loop.used_ns) * _NS
    if silence > rules.lost_after:
        return LOST
    if loop.gated:
        return REJECTING
    if silence > rules.coast_after:
        return COASTING
    return TRACKING if loop.settled else INITIALISING


@_compiled()
def _follow_trend(loop: Record, rules: Record, b: Record, now_ns: int) -> None:
    """Smooth the leader's turn rate, as ``Foresight.heard`` does."""
    ahead = (now_ns + rules.ahead_ns - loop.track_ns) * _NS
    window = 0.5 * (b.u_u + rules.q_u * ahead) / rules.q_u
    if not loop.known:
        loop.slow_u1 = b.u
    else:
        share = -math.expm1(-((loop.track_ns - loop.capture_ns) * _NS) / window) if window > 0.0 else 1.0
        loop.slow_u1 += share * (b.u - loop.slow_u1)


@_compiled()
def _tell_controller(
    loop: Record, rules: Record, b: Record, pose: Record, frame: Record, now_ns: int
) -> None:
    """Hand over an estimate that may move the robot, along the follower's axes."""
    dx, dy, c, s = b.x - pose.x, b.y - pose.y, pose.cos, pose.sin
    loop.x, loop.y = c * dx + s * dy, c * dy - s * dx
    loop.vx, loop.vy = c * b.vx + s * b.vy, c * b.vy - s * b.vx
    _follow_trend(loop, rules, b, now_ns)
    loop.u1, loop.var_u1, loop.v2, loop.u2 = b.u, b.u_u, frame.v2, frame.u2
    loop.known, loop.capture_ns, loop.measured_ns = 1, loop.track_ns, loop.used_ns


@_compiled()
def _publish(run: Record, now_ns: int) -> None:
    """Give the newest estimate to the controller, and keep it if it is to be judged."""
    loop, rules = run.loop, run.rules
    loop.status = _status(loop, rules, now_ns)
    loop.published_ns = now_ns
    track = _belief(run.beliefs, _TRACK)
    if loop.status == TRACKING:
        _tell_controller(loop, rules, track, run.watch, _frame(run.frames, loop.track_frame), now_ns)
    if rules.from_ns >= 0 and (loop.since_ns < 0 or loop.track_ns < loop.since_ns + rules.from_ns):
        return
    told = _told(run.told, loop.told)
    told.frame, told.measured_ns, told.now_ns = loop.track_frame, loop.used_ns, now_ns
    told.status, told.nis = loop.status, loop.nis
    told.doubt_position, told.doubt_heading = loop.doubt_position, loop.doubt_heading
    told.x, told.y, told.cos, told.sin = run.watch.x, run.watch.y, run.watch.cos, run.watch.sin
    _copy(track, _belief(run.kept, loop.told))
    loop.told += 1


@_compiled()
def _take_frame(run: Record, number: int, now_ns: int) -> bool:
    """``EstimatorNode`` given a frame: whether it leads to an estimate."""
    loop, frame = run.loop, _frame(run.frames, number)
    dx, dy = frame.lx - frame.fx, frame.ly - frame.fy
    if math.sqrt(dx * dx + dy * dy) < _SAME_PLACE:
        return False
    _own_motion(frame, run.samples, loop.heard, run.rules)
    _follow(run, frame, number)
    loop.track_ns, loop.track_frame = frame.at_ns, number
    _publish(run, now_ns)
    return True


# The controller node


@_compiled()
def _predict_follower(
    loop: Record, rules: Record, sent: int, arcs: int, until_ns: int
) -> tuple[float, float, float, float]:
    """Where the follower will be, seen from where it was at the capture, along the commands sent since."""
    x, y, c, s = 0.0, 0.0, 1.0, 0.0
    v, u = loop.v2, loop.u2
    goal_v, goal_u = v, u
    at_ns = loop.capture_ns
    for k in range(loop.first_sent, loop.sent + 1):
        end_ns = min(_sent(sent, k).at_ns, until_ns) if k < loop.sent else until_ns
        if end_ns > at_ns:
            if k == loop.first_sent:
                goal_v, goal_u = v, u
            arc = _arcs(arcs, end_ns - at_ns, rules.assumed_lag, _PREDICTED_ARC, 0.0)
            decay, share, step = arc.decay, arc.share, arc.step
            for _ in range(arc.pieces):
                v_off, u_off = v - goal_v, u - goal_u
                x, y, c, s = _advance(x, y, c, s, goal_v + v_off * share, goal_u + u_off * share, step)
                v, u = goal_v + v_off * decay, goal_u + u_off * decay
            at_ns = end_ns
        command = _sent(sent, k)
        goal_v, goal_u = command.v, command.u
    return x, y, c, s


@_compiled()
def _law(
    rules: Record, leader_u1: float, v1: float, rho: float, one: tuple[float, float], two: tuple[float, float]
) -> tuple[float, float]:
    """Wanted speed and turn rate; ``one``, ``two``: cosine and sine of alpha1 and alpha2."""
    f = rules.mu_rho * ((rho - rules.rho_0) / rho) * ((rho + rules.rho_0) / rho)
    v2 = -v1 * one[1] + rho * (v1 * f - rules.mu1 * one[0])
    if rules.law != INDEPENDENT:
        v2 += rho * leader_u1
    driven = v2
    if v2 > rules.v_limit:
        driven = rules.v_limit
    elif v2 < -rules.v_limit:
        driven = -rules.v_limit
    return v2, -rules.mu2 * two[0] + (v1 * one[1] + driven * two[1]) / rho


@_compiled()
def _further(loop: Record, rules: Record, ahead: float) -> float:
    """By how much the leader will have turned further than by its estimated u1 (``Foresight.further``)."""
    if rules.law == FEEDFORWARD:
        return 0.0
    held = loop.var_u1 + rules.q_u * ahead
    share = max(0.0, 1.0 - _LEFT_OF_HEADING * held / rules.spread)
    angle: float = share * (loop.u1 - loop.slow_u1) * held / rules.q_u
    return angle


@_compiled()
def _wanted(loop: Record, rules: Record, sent: int, arcs: int, now_ns: int) -> tuple[float, float]:
    """Predict the shape to when the command acts, and ask the law."""
    v1 = math.sqrt(loop.vx * loop.vx + loop.vy * loop.vy)
    lx, ly, lc, ls = loop.x, loop.y, 1.0, 0.0
    if v1 > 0.0:
        lc, ls = loop.vx / v1, loop.vy / v1
    fx, fy, fc, fs = 0.0, 0.0, 1.0, 0.0
    until_ns = now_ns + rules.ahead_ns
    total = (until_ns - loop.capture_ns) * _NS
    if total > 0.0:
        u1 = loop.u1 + _further(loop, rules, total) / total
        x, y, c, s = _advance(lx, ly, lc, ls, v1, u1, total)
        at_x, at_y, at_c, at_s = _predict_follower(loop, rules, sent, arcs, until_ns)
        if x != at_x or y != at_y:
            lx, ly, lc, ls = x, y, c, s
            fx, fy, fc, fs = at_x, at_y, at_c, at_s
    dx, dy = fx - lx, fy - ly
    rho = math.sqrt(dx * dx + dy * dy)
    one = (dx * lc + dy * ls) / rho, (dy * lc - dx * ls) / rho
    two = -(dx * fc + dy * fs) / rho, (dx * fs - dy * fc) / rho
    return _law(rules, _leader_turn(loop, rules, total), v1, rho, one, two)


@_compiled()
def _leader_turn(loop: Record, rules: Record, ahead: float) -> float:
    """The leader's turn rate as told, or as foreseen (``estimation.tracking.foresight``)."""
    told: float = loop.leader_u1
    if rules.law == IDEAL:
        return told
    u1: float = max(-rules.k_u, min(rules.k_u, loop.u1 + 2.0 * (loop.u1 - loop.slow_u1)))
    if rules.law == FADED:
        doubt = (loop.var_u1 + rules.q_u * ahead) / rules.spread
        u1 *= max(0.0, 1.0 - _ERRORS_TOGETHER * doubt * doubt)
    return u1


@_compiled()
def _can_be(loop: Record) -> bool:
    """Whether the numbers of the estimate are such as a sound estimator gives."""
    rho, v1 = math.sqrt(loop.x * loop.x + loop.y * loop.y), math.sqrt(loop.vx * loop.vx + loop.vy * loop.vy)
    own = abs(loop.v2) < _LARGEST and abs(loop.u2) < _LARGEST
    return 0.0 < rho < _LARGEST and v1 < _LARGEST and abs(loop.u1) < _LARGEST and own


@_compiled()
def _refusal(loop: Record, rules: Record, now_ns: int) -> int:
    """Why the follower has to stand still, in the order of ``StopReason``; DRIVING if nothing speaks so."""
    if loop.stopped:
        return STOPPED
    if not loop.known:
        return NO_ESTIMATE
    if loop.status == LOST:
        return GIVEN_UP
    if loop.status == INITIALISING:
        return NOT_SETTLED
    age = (now_ns - loop.measured_ns) * _NS
    if not -_CLOCK_TOLERANCE <= age <= rules.max_age:
        return STALE
    return DRIVING if _can_be(loop) else NOT_FINITE


@_compiled()
def _in_steps(value: float, step: float, bound: float) -> tuple[float, float]:
    """Value in whole steps, and what that leaves for the next one (``controllers.resolution``)."""
    if step <= 0.0:
        return value, 0.0
    most = math.floor(bound / step + _HAIR)
    steps = max(-most, min(most, math.floor(value / step + 0.5)))
    rest = max(-0.5 * step, min(0.5 * step, value - steps * step))
    hair = math.copysign(_HAIR, steps) if steps else 0.0
    return max(-bound, min(bound, (steps + hair) * step)), rest


@_compiled()
def _drive_command(loop: Record, rules: Record, command: Record, v: float, u: float) -> None:
    v, u = max(-rules.v_limit, min(rules.v_limit, v)), max(-rules.u_limit, min(rules.u_limit, u))
    command.v, loop.owed_v = _in_steps(v + loop.owed_v, rules.v_step, rules.v_limit)
    command.u, loop.owed_u = _in_steps(u + loop.owed_u, rules.u_step, rules.u_limit)


@_compiled()
def _send(loop: Record, rules: Record, sent: int, arcs: int, now_ns: int) -> None:
    """Decide on a command, and forget those that no prediction will need any more."""
    k = loop.sent
    command = _sent(sent, k)
    command.at_ns = now_ns + rules.transport_ns
    command.v, command.u = 0.0, 0.0
    command.reason = _refusal(loop, rules, now_ns)
    if command.reason == DRIVING:
        v, u = _wanted(loop, rules, sent, arcs, now_ns)
        if math.isfinite(v) and math.isfinite(u):
            _drive_command(loop, rules, command, v, u)
        else:
            command.reason = NOT_FINITE
    if command.reason != DRIVING:
        loop.owed_v = loop.owed_u = 0.0
    loop.sent = k + 1
    if not loop.known:
        loop.first_sent = k
        return
    begin_ns = max(loop.capture_ns, now_ns - rules.max_age_ns)
    while loop.first_sent < k and _sent(sent, loop.first_sent + 1).at_ns <= begin_ns:
        loop.first_sent += 1


@_compiled()
def _command(run: Record, now_ns: int) -> None:
    """A command of the controller, and what it does to the follower."""
    loop, rules = run.loop, run.rules
    _send(loop, rules, run.sent, run.predicted, now_ns)
    loop.controller_tick_ns = now_ns + rules.tick_ns
    if now_ns >= loop.controller_report_ns:
        loop.controller_report_ns = now_ns + _REPORT_NS
        loop.controller_well = loop.controller_well or loop.published_ns >= 0
    _move(run, now_ns)
    if loop.stopped:
        _tell(run.follower, rules, 0.0, 0.0)
    else:
        command = _sent(run.sent, loop.sent - 1)
        _tell(run.follower, rules, command.v, command.u)
    loop.commanded = 1


# The clock


@_compiled()
def _world(run: Record, now_ns: int) -> tuple[int, bool]:
    """All that is due in the lab: the frame that arrives, -1 for none, and whether before any odometry."""
    loop, rules = run.loop, run.rules
    arrived, early, sampled = -1, False, False
    while True:
        sample, frame = _sample(run.samples, loop.odometry), _frame(run.frames, loop.frames)
        if _release_ns(loop, run.frames, rules.latency_ns) <= now_ns:
            arrived, early = loop.pending, not sampled
            loop.pending += 1
        elif sample.at_ns <= now_ns:
            _move(run, now_ns)
            _sample_odometry(sample, run.follower, rules, _motion(run.odometry_normals, loop.odometry))
            loop.leader_u1 = run.leader.goal_u
            loop.odometry += 1
            sampled = True
        elif frame.at_ns <= now_ns:
            _move(run, now_ns)
            _lead(run, now_ns)
            normal, shares = (
                _frame_normals(run.frame_normals, loop.frames),
                _shares(run.frame_shares, loop.frames),
            )
            _capture(frame, run.leader, run.follower, rules, normal, shares.lost)
            loop.frames += 1
        else:
            return arrived, early


@_compiled()
def _emulator_tick(run: Record, now_ns: int) -> None:
    """Let the lab catch up; then frame and odometry are read in the order in which they were sent."""
    loop = run.loop
    arrived, early = _world(run, now_ns)
    if not early:
        loop.heard = loop.odometry
    news = arrived >= 0 and _take_frame(run, arrived, now_ns)
    loop.heard = loop.odometry
    if news:
        _command(run, now_ns)


@_compiled()
def _estimator_tick(run: Record, now_ns: int) -> None:
    loop = run.loop
    status = _status(loop, run.rules, now_ns)
    if status in (COASTING, LOST) and (now_ns - loop.published_ns) * 2 > _ESTIMATOR_TICK_NS:
        _publish(run, now_ns)
        _command(run, now_ns)
    if now_ns >= loop.estimator_report_ns:
        loop.estimator_report_ns = now_ns + _REPORT_NS
        loop.estimator_well = loop.estimator_well or (loop.begun and loop.heard > 0)
    loop.estimator_tick_ns = now_ns + _ESTIMATOR_TICK_NS


@_compiled()
def _stop(run: Record, now_ns: int) -> None:
    """The operator's stop at the end of the run, as emulator and controller take it."""
    _move(run, now_ns)
    run.loop.stopped = 1
    _tell(run.leader, run.rules, 0.0, 0.0)
    _command(run, now_ns)


@_compiled(from_dtype(RUN)[::1])
def fly(runs: Records) -> bool:
    """The one run in ``runs`` from the start barrier to ``after_ns`` past the stop.

    False if the leader does not set off within ``patience_ns``. The robots stand at their start poses, and
    the loop's fields are all zero, except that ``since_ns`` and ``published_ns`` are -1 and ``leader_u1`` is
    nan.
    """
    run = runs[0]
    loop, rules = run.loop, run.rules
    end_ns = rules.patience_ns
    while True:
        due_ns = min(_frame(run.frames, loop.frames).at_ns, _sample(run.samples, loop.odometry).at_ns)
        due_ns = min(due_ns, _release_ns(loop, run.frames, rules.latency_ns))
        now_ns = min(due_ns, loop.estimator_tick_ns, loop.controller_tick_ns)
        if now_ns > end_ns:
            if loop.stopped or loop.since_ns < 0:
                return bool(loop.since_ns >= 0)
            _stop(run, end_ns)
            end_ns += rules.after_ns
        elif due_ns == now_ns:
            _emulator_tick(run, now_ns)
            if loop.since_ns >= 0 and not loop.stopped:
                end_ns = loop.since_ns + rules.duration_ns
        elif loop.estimator_tick_ns == now_ns:
            _estimator_tick(run, now_ns)
        else:
            _command(run, now_ns)


# What the judge looks at


@_compiled()
def _variance(b: Record, gx: float, gy: float, hx: float, hy: float) -> float:
    """Variance of g p + h w, for position p and velocity w of a belief."""
    of_p = gx * gx * b.x_x + 2.0 * gx * gy * b.x_y + gy * gy * b.y_y
    of_w = hx * hx * b.vx_vx + 2.0 * hx * hy * b.vx_vy + hy * hy * b.vy_vy
    return float(of_p + of_w + 2.0 * (gx * (hx * b.x_vx + hy * b.x_vy) + gy * (hx * b.y_vx + hy * b.y_vy)))


@_compiled()
def _express_spread(b: Record, pose: Record, noise: Record, e: Record) -> None:
    """Variances of an estimate whose values are there: ``estimate_of``, in the axes of the world."""
    dx, dy, wx, wy = b.x - pose.x, b.y - pose.y, b.vx, b.vy
    rho, speed = max(e.rho, 1e-9), max(e.v1, 1e-9)
    ex, ey = (dx / e.rho, dy / e.rho) if e.rho > 0.0 else (pose.cos, pose.sin)
    nx, ny = -ey, ex
    ahead, left = ex * pose.cos + ey * pose.sin, nx * pose.cos + ny * pose.sin
    rx, ry = wx - e.v2 * pose.cos, wy - e.v2 * pose.sin
    along, across = ex * rx + ey * ry, nx * rx + ny * ry
    position, heading = noise.position * noise.position, noise.heading * noise.heading
    speed_noise, turn_noise = noise.v2 * noise.v2, noise.u2 * noise.u2
    # Each quantity by position and velocity; the heading of the follower turns both back.
    gx, gy = nx * across / rho, ny * across / rho
    turned = gx * dy - gy * dx + ex * wy - ey * wx
    e.var_rho_dot = _variance(b, gx, gy, ex, ey) + position * (gx * gx + gy * gy) + heading * turned * turned
    e.var_rho_dot += speed_noise * ahead * ahead
    gx, gy = -(nx * along + ex * across) / (rho * rho), -(ny * along + ey * across) / (rho * rho)
    hx, hy = nx / rho, ny / rho
    turned = gx * dy - gy * dx + hx * wy - hy * wx
    e.var_alpha2_dot = _variance(b, gx, gy, hx, hy) + position * (gx * gx + gy * gy)
    e.var_alpha2_dot += heading * turned * turned + speed_noise * left * left / (rho * rho) + turn_noise
    e.var_v1 = _variance(b, 0.0, 0.0, wx / speed, wy / speed)
    gx, gy, hx, hy = nx / rho, ny / rho, wy / (speed * speed), -wx / (speed * speed)
    turned = gx * dy - gy * dx + hx * wy - hy * wx
    e.var_alpha1 = _variance(b, gx, gy, hx, hy) + position * (gx * gx + gy * gy) + heading * turned * turned
    e.var_u1 = b.u_u


@_compiled()
def _express(b: Record, pose: Record, v2: float, u2: float, noise: Record, e: Record) -> None:
    """Estimate out of a belief and the follower's pose: ``estimate_of``, in the axes of the world."""
    dx, dy = b.x - pose.x, b.y - pose.y
    c, s = pose.cos, pose.sin
    px, py = c * dx + s * dy, c * dy - s * dx
    wx, wy = c * b.vx + s * b.vy, c * b.vy - s * b.vx
    e.rho, e.alpha2 = math.sqrt(px * px + py * py), math.atan2(py, px)
    ex, ey = (px / e.rho, py / e.rho) if e.rho > 0.0 else (1.0, 0.0)
    e.rho_dot = ex * (wx - v2) + ey * wy
    e.alpha2_dot = (ex * wy - ey * (wx - v2)) / max(e.rho, 1e-9) - u2
    e.v1 = math.sqrt(wx * wx + wy * wy)
    hx, hy = (wx, wy) if e.v1 > 0.0 else (1.0, 0.0)
    e.alpha1 = math.atan2(ex * hy - ey * hx, -ex * hx - ey * hy)
    e.u1, e.v2, e.u2 = b.u, v2, u2
    _express_spread(b, pose, noise, e)


@_compiled(from_dtype(RUN)[::1], from_dtype(ESTIMATE)[::1])
def express(runs: Records, estimates: Records) -> None:
    """Fill in the estimates that the run in ``runs`` has told."""
    run = runs[0]
    noise, rules = run.noise, run.rules
    for k in range(run.loop.told):
        told = _told(run.told, k)
        frame = _frame(run.frames, told.frame)
        # A doubt acts like noise of the follower's pose.
        noise.position = math.hypot(rules.sd_position, told.doubt_position)
        noise.heading = math.hypot(rules.sd_heading, told.doubt_heading)
        noise.v2, noise.u2 = frame.sd_v2, frame.sd_u2
        _express(_belief(run.kept, k), told, frame.v2, frame.u2, noise, estimates[k])


@_compiled()
def _set_truth(b: Record, frame: Record) -> None:
    c, s = math.cos(frame.true_lheading), math.sin(frame.true_lheading)
    b.x, b.y, b.u = frame.true_lx, frame.true_ly, frame.true_u1
    b.vx, b.vy = frame.true_v1 * c, frame.true_v1 * s


@_compiled()
def _carry_bound(run: Record, k: int, known: bool) -> bool:
    """Bound after frame k, in the belief of the track, from that before; whether it is known by then."""
    rules, spread = run.rules, run.rules.sigma_position * run.rules.sigma_position
    bound, prior, frame = _belief(run.beliefs, _TRACK), _belief(run.beliefs, _PRIOR), _frame(run.frames, k)
    if known:
        last = _frame(run.frames, k - 1)
        _set_truth(bound, last)
        _extended_predict(bound, prior, (frame.at_ns - last.at_ns) * _NS, rules)
        if frame.lost:
            _copy(prior, bound)
        else:
            _inform(prior, bound, spread, prior.x, prior.y)
        return True
    if frame.lost:
        return False
    _clear(bound)
    bound.x_x = bound.y_y = spread
    bound.vx_vx = bound.vy_vy = rules.k_v * rules.k_v
    bound.u_u = rules.k_u * rules.k_u
    return True


@_compiled(from_dtype(RUN)[::1], types.int64, types.boolean[::1], from_dtype(ESTIMATE)[::1])
def least_variances(runs: Records, first: int, wanted: NDArray[np.bool_], total: Records) -> int:
    """Sum up the posterior Cramer-Rao bound (``consistency.cramer_rao``) over frames of a flown run.

    The recursion begins at the first frame received from ``first`` on; ``wanted`` tells the frames whose
    variances are added to ``total`` (1,), and their number is returned.
    """
    run, rules, sums = runs[0], runs[0].rules, total[0]
    pose, noise, here = run.pose, run.noise, run.here
    noise.position, noise.heading = rules.sigma_position, rules.sigma_heading
    noise.v2, noise.u2 = rules.odometry_sigma_v, rules.odometry_sigma_u
    known, count = False, 0
    for k in range(first, len(wanted)):
        known = _carry_bound(run, k, known)
        if not (known and wanted[k]):
            continue
        bound, frame = _belief(run.beliefs, _TRACK), _frame(run.frames, k)
        _set_truth(bound, frame)
        pose.x, pose.y = frame.true_fx, frame.true_fy
        pose.cos, pose.sin = math.cos(frame.true_fheading), math.sin(frame.true_fheading)
        _express(bound, pose, frame.true_v2, frame.true_u2, noise, here)
        sums.var_rho_dot += here.var_rho_dot
        sums.var_alpha2_dot += here.var_alpha2_dot
        sums.var_v1 += here.var_v1
        sums.var_alpha1 += here.var_alpha1
        sums.var_u1 += here.var_u1
        count += 1
    return count
