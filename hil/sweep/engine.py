"""Runs of one scenario by the compiled closed loop, each equal to a lockstep run of the same seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from estimation.estimate import QUANTITIES
from estimation.estimators import settling
from estimation.motion import LeaderLimits, ProcessNoise
from estimation.tracking import TrackSettings
from formation.leader import Table
from formation.pose import Pose
from hil.emulator.mocap import Stream, block_length
from hil.errors import CheckFailedError, UsageError
from hil.nodes.lockstep_run import STOPPING_NS
from hil.scenario.parts import foresight, leader_program
from hil.scenario.schema import ConstantProgram, ImpulseProgram, Scenario, SinusoidProgram
from hil.scenario.start import start_poses
from hil.sweep import engine_kernels as kernels
from hil.sweep.noise_kernels import draw

KINDS = {"ekf": kernels.EKF, "ukf": kernels.UKF, "difference": kernels.DIFFERENCE}
LAWS = {
    "independent": kernels.INDEPENDENT,
    "ideal": kernels.IDEAL,
    "feedforward": kernels.FEEDFORWARD,
    "faded": kernels.FADED,
}
LONGEST_LATENCY = 1.0
"""Seconds of latency that the history of odometry surely covers."""

_KNOWN = {
    "formation": {"rho_0"},
    "controller": {
        *("law", "mu1", "mu2", "mu_rho", "v_max", "u_max", "max_age_s", "lag_s", "transport_s", "tick_hz"),
        *("v_resolution", "u_resolution", "command_type"),
    },
    "robot": {
        *("lag_s", "v_max", "u_max", "v_resolution", "u_resolution"),
        *("odometry_rate_hz", "odometry_sigma_v", "odometry_sigma_u"),
    },
    "mocap": {"rate_hz", "sigma_position", "sigma_heading", "static_fraction", "latency_s", "loss"},
    "estimator": {
        *("kind", "sigma_position", "sigma_heading", "sigma_range", "sigma_bearing", "sigma_v2", "sigma_u2"),
        *("turn_bandwidth", "speed_bandwidth", "gate_probability", "reacquire_frames", "coast_after_s"),
        *("lost_after_s", "window_s", "difference_cutoff_s", "range_bias", "bearing_bias"),
    },
}
"""Keys that the compiled loop knows, or may ignore as they concern no world front end."""

_NS = 1e-9
_SOON_S, _AT_LAST_S = 3.0, 10.0
"""Nearly every leader has set off by the first [s], with less noise to draw; after the second none will."""
_SPARE_S = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What a run left behind, as views that the engine's next run overwrites; see ``engine_kernels.Run``.

    ``frames``: all captures until the end. ``told``, ``kept``: estimates and the beliefs behind them.
    ``sent``: commands. ``since_ns``: when the leader set off; times count from where the emulator begins.
    """

    since_ns: int
    frames: kernels.Records
    told: kernels.Records
    kept: kernels.Records
    sent: kernels.Records


@dataclass(frozen=True, slots=True, eq=False)
class LeastVariances:
    """Mean over ``count`` moments of the variances that nobody could beat, by the names of the quantities."""

    count: int
    variances: dict[str, float]


class _Numbers:
    """Memory for a stream's random numbers: ``count`` normals and two uniforms for each of its items.

    Without ``uniform`` the uniforms stay zero, and no normals are drawn past the last item.
    """

    def __init__(self, stream: Stream, items: int, count: int, *, uniform: bool = False) -> None:
        self._stream, self._uniform = stream, uniform
        length = block_length(stream)
        self._firsts = range(0, items, length)
        rows = len(self._firsts) * length if uniform else items
        self.normals, self.shares = np.zeros((rows, count)), np.zeros((rows, 2))

    def draw(self, seed: int) -> None:
        """The numbers of a seed, as ``hil.emulator.mocap.draw_block`` has them."""
        length = block_length(self._stream)
        for block, first in enumerate(self._firsts):
            normals = self.normals[first : first + length].reshape(-1)
            shares = self.shares[first : first + length if self._uniform else first].reshape(-1)
            draw(seed, self._stream, block, normals, shares)


class Engine:
    """Flies runs of a scenario that differ by their seed.

    ``every_estimate``: keep all estimates and let the robots come to rest after the stop, as a lockstep run
    does; else only estimates in the evaluated time are kept. Raises :class:`UsageError` for a scenario with
    something in it that the compiled loop does not have.
    """

    def __init__(self, scenario: Scenario, *, every_estimate: bool = False) -> None:
        refuse_unknown(scenario)
        self.scenario = scenario
        self._run = np.zeros(1, kernels.RUN)
        rules = self._run["rules"]
        for name, value in _rules(scenario, every_estimate=every_estimate).items():
            rules[name] = value
        self._poses = start_poses(scenario)
        self._furnish(_SOON_S)

    def _furnish(self, patience: float) -> None:
        """Memory for runs that set off within ``patience`` [s]."""
        scenario, rules = self.scenario, self._run["rules"]
        rules["patience_ns"] = round(patience / _NS)
        seconds = patience + _SPARE_S + float(rules["duration_ns"][0] + rules["after_ns"][0]) * _NS
        captures_ns = _dues(scenario.mocap.rate_hz, seconds)
        odometry_ns = _dues(scenario.robot.odometry_rate_hz, seconds)
        commands = len(captures_ns) + math.ceil(seconds * (scenario.controller.tick_hz + 20.0)) + 2
        self._memory = _memory(_table(scenario), captures_ns, odometry_ns, commands)
        for name, array in self._memory.items():
            self._run[name] = array.ctypes.data
        self._mocap = _Numbers(Stream.MOCAP, len(captures_ns), 6, uniform=scenario.mocap.loss > 0.0)
        self._odometry = _Numbers(Stream.FOLLOWER_ODOMETRY, len(odometry_ns), 2)
        self._run["frame_normals"] = self._mocap.normals.ctypes.data
        self._run["frame_shares"] = self._mocap.shares.ctypes.data
        self._run["odometry_normals"] = self._odometry.normals.ctypes.data
        self._estimates = np.zeros(commands, kernels.ESTIMATE)
        self._run["table_rows"] = len(self._memory["table"])

    def _flown(self, seed: int) -> bool:
        self._mocap.draw(seed)
        self._odometry.draw(seed)
        self._reset()
        return kernels.fly(self._run)

    @property
    def transport_ns(self) -> int:
        """By how much a command acts after it was sent."""
        return int(self._run["rules"]["transport_ns"][0])

    def fly(self, seed: int) -> Flight:
        """One run. Raises :class:`CheckFailedError` if the leader never sets off."""
        if not self._flown(seed):
            self._furnish(_AT_LAST_S)
            if not self._flown(seed):
                raise CheckFailedError(
                    f"run with seed {seed}: the start barrier did not open within {_AT_LAST_S:g} s; "
                    "check mocap.loss, mocap.latency_s and the rates"
                )
        run, memory = self._run, self._memory
        loop = run["loop"][0]
        return Flight(
            since_ns=int(loop["since_ns"]),
            frames=memory["frames"][: loop["frames"]],
            told=memory["told"][: loop["told"]],
            kept=memory["kept"][: loop["told"]],
            sent=memory["sent"][: loop["sent"]],
        )

    def estimates(self) -> kernels.Records:
        """The estimates of the last run, one for each that it told of, with their variances."""
        told = int(self._run["loop"]["told"][0])
        estimates = self._estimates[:told]
        kernels.express(self._run, estimates)
        return estimates

    def least_variances(self, first: int, wanted: NDArray[np.bool_]) -> LeastVariances:
        """Posterior Cramer-Rao bound on the last run's path, over the wanted of its frames.

        ``first``: the frame at which the recursion begins. It works in the memory of the run: ask for
        estimates before.
        """
        total = np.zeros(1, kernels.ESTIMATE)
        count = kernels.least_variances(self._run, first, wanted, total)
        sums = {name: float(total[f"var_{name}"][0]) for name in QUANTITIES}
        return LeastVariances(count, {name: each / max(count, 1) for name, each in sums.items()})

    def _reset(self) -> None:
        run = self._run
        run["loop"] = np.zeros(1, kernels.LOOP)
        run["loop"]["since_ns"] = run["loop"]["published_ns"] = -1
        run["loop"]["leader_u1"] = math.nan
        for name, pose in zip(("leader", "follower"), self._poses, strict=True):
            run[name] = _standing(pose)


def refuse_unknown(scenario: Scenario) -> None:
    """Raise :class:`UsageError` for what lockstep runs can do and the compiled loop cannot.

    Keys that it knows nothing of must have their defaults. Frames that keep their order need no ring to
    rewind, so that there is none, and no jitter.
    """
    estimator, law = scenario.estimator.kind, scenario.controller.law
    if estimator not in KINDS:
        raise _unknown(scenario, "estimator.kind", estimator, f"one of {', '.join(KINDS)}")
    if law not in LAWS:
        raise _unknown(scenario, "controller.law", law, f"one of {', '.join(LAWS)}")
    if scenario.mocap.latency_s > LONGEST_LATENCY:
        raise _unknown(scenario, "mocap.latency_s", scenario.mocap.latency_s, f"at most {LONGEST_LATENCY:g}")
    for name, known in _KNOWN.items():
        section: msgspec.Struct = getattr(scenario, name)
        for key in msgspec.structs.fields(section):
            value = getattr(section, key.name)
            if key.name not in known and value != key.default:
                raise _unknown(scenario, f"{name}.{key.name}", value, repr(key.default))


def _unknown(scenario: Scenario, key: str, value: object, expected: str) -> UsageError:
    return UsageError(
        f"scenario {scenario.name}: {key} is {value!r}, but a sweep takes {expected}; "
        "set it so, or use abreast run --lockstep"
    )


def evaluation_ns(scenario: Scenario) -> tuple[int, int]:
    """From when to when a run is judged, counted from the leader's start; as ``hil.judge.evidence``."""
    to_ns = round(scenario.run.duration_s * 1e9)
    from_ns = round(scenario.run.evaluate_from_s * 1e9)
    return (from_ns if from_ns < to_ns else to_ns // 2), to_ns


def _rules(scenario: Scenario, *, every_estimate: bool) -> dict[str, float]:
    """All that is fixed in a run, by the fields of ``engine_kernels.RULES``."""
    latency_ns = round(scenario.mocap.latency_s / _NS)
    return {
        "latency_ns": latency_ns,
        "duration_ns": evaluation_ns(scenario)[1],
        "after_ns": STOPPING_NS if every_estimate else min(latency_ns, STOPPING_NS),
        "from_ns": -1 if every_estimate else evaluation_ns(scenario)[0],
        **_lab(scenario),
        **_eye(scenario),
        **_hand(scenario),
    }


def _lab(scenario: Scenario) -> dict[str, float]:
    robot, mocap = scenario.robot, scenario.mocap
    kind, numbers = _program(scenario)
    return {
        "program": kind,
        **{f"p{k}": number for k, number in enumerate(numbers)},
        "lag": robot.lag_s,
        "v_max": robot.v_max,
        "u_max": robot.u_max,
        "v_resolution": robot.v_resolution,
        "u_resolution": robot.u_resolution,
        "sigma_position": mocap.sigma_position,
        "sigma_heading": mocap.sigma_heading,
        "static_fraction": mocap.static_fraction,
        "odometry_sigma_v": robot.odometry_sigma_v,
        "odometry_sigma_u": robot.odometry_sigma_u,
        "loss": mocap.loss,
    }


def _eye(scenario: Scenario) -> dict[str, float]:
    given, leader = scenario.estimator, scenario.leader
    limits = LeaderLimits(leader.v_eps, leader.k_v, leader.k_u)
    noise = ProcessNoise.by_rule(limits, given.turn_bandwidth, given.speed_bandwidth)
    return {
        "kind": KINDS[given.kind],
        "reacquire_frames": given.reacquire_frames,
        "q_v": noise.q_v,
        "q_u": noise.q_u,
        "q_start": noise.q_start,
        "v_eps": noise.v_eps,
        "k_v": leader.k_v,
        "k_u": leader.k_u,
        "sd_position": given.sigma_position,
        "sd_heading": given.sigma_heading,
        "sd_v2": given.sigma_v2,
        "sd_u2": given.sigma_u2,
        "gate": -2.0 * math.log1p(-given.gate_probability),
        "coast_after": given.coast_after_s,
        "lost_after": given.lost_after_s,
        **settling(given.kind)._asdict(),
        "doubt_for": TrackSettings().doubt_for,
        "cutoff": given.difference_cutoff_s,
    }


def _hand(scenario: Scenario) -> dict[str, float]:
    given = scenario.controller
    transport_ns = round(given.transport_s / _NS)
    return {
        "law": LAWS[given.law],
        "tick_ns": round(1.0 / given.tick_hz / _NS),
        "transport_ns": transport_ns,
        "ahead_ns": transport_ns + round(given.lag_s / _NS),
        "max_age_ns": round(given.max_age_s / _NS),
        "max_age": given.max_age_s,
        "assumed_lag": given.lag_s,
        "mu1": given.mu1,
        "mu2": given.mu2,
        "mu_rho": given.mu_rho,
        "rho_0": scenario.formation.rho_0,
        "v_limit": given.v_max,
        "u_limit": given.u_max,
        "v_step": given.v_resolution,
        "u_step": given.u_resolution,
        "spread": foresight(scenario).spread,
    }


def _program(scenario: Scenario) -> tuple[int, tuple[float, ...]]:
    """Kind of the leader's program, and the numbers of its formula."""
    given = scenario.leader.program
    if isinstance(given, ConstantProgram):
        return kernels.CONSTANT, (given.v, given.u)
    if isinstance(given, SinusoidProgram):
        return kernels.SINUSOID, (given.v, given.u_mean, given.u_amplitude, given.omega)
    if isinstance(given, ImpulseProgram):
        return kernels.IMPULSE, (given.v, given.u_amplitude, given.t_centre, given.t_width)
    return kernels.TABLE, ()


def _table(scenario: Scenario) -> kernels.Records:
    """Rows of the leader's program if it is a table, else none."""
    program = leader_program(scenario)
    rows = (program.t, program.v, program.u) if isinstance(program, Table) else ()
    return np.array(list(zip(*rows, strict=True)), dtype=kernels.TURN)


def _dues(rate: float, seconds: float) -> NDArray[np.int64]:
    """When things that happen at a rate are due [ns], rounded as the emulator rounds."""
    return np.rint(np.arange(math.ceil(seconds * rate) + 2) / rate / _NS).astype(np.int64)


def _standing(pose: Pose) -> tuple[float, ...]:
    return pose.x, pose.y, pose.theta, math.cos(pose.theta), math.sin(pose.theta), 0.0, 0.0, 0.0, 0.0


def _memory(
    table: kernels.Records, captures_ns: NDArray[np.int64], odometry_ns: NDArray[np.int64], commands: int
) -> dict[str, kernels.Records]:
    """Arrays by the names under which ``engine_kernels.RUN`` has their addresses."""
    frames, samples = np.zeros(len(captures_ns), kernels.FRAME), np.zeros(len(odometry_ns), kernels.SAMPLE)
    frames["at_ns"], samples["at_ns"] = captures_ns, odometry_ns
    return {
        "table": table,
        "beliefs": np.zeros(4, kernels.BELIEF),
        "columns": np.zeros(5, kernels.STATE),
        "points": np.zeros(10, kernels.STATE),
        "driven": np.zeros(kernels.SLOTS, kernels.ARC),
        "predicted": np.zeros(kernels.SLOTS, kernels.ARC),
        "frames": frames,
        "samples": samples,
        "told": np.zeros(commands, kernels.TOLD),
        "kept": np.zeros(commands, kernels.BELIEF),
        "sent": np.zeros(commands, kernels.SENT),
    }
