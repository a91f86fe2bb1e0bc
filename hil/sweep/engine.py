"""Runs of one scenario by the compiled closed loop, each equal to a lockstep run of the same seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.estimate import QUANTITIES
from formation.leader import Table
from formation.pose import Pose
from hil.emulator.mocap import Stream, block_length
from hil.errors import CheckFailedError
from hil.scenario.parts import leader_program
from hil.scenario.schema import Scenario
from hil.scenario.start import start_poses
from hil.sweep import engine_kernels as kernels
from hil.sweep.engine_rules import refuse_unknown, rules_of
from hil.sweep.noise_kernels import draw

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
        for name, value in rules_of(scenario, every_estimate=every_estimate).items():
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
