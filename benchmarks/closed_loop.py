"""How far the driven pair strays from the noise-free orbit, and what that is made of.

    python benchmarks/closed_loop.py [--seeds 4] [--duration 30] [ROW ...]

The scenario ``turtlebot3`` in lockstep (120 Hz, 0.3 mm, 0.2 deg, 30 ms latency, 100 ms actuator lag) with one
thing changed in every row; judged from half of the run on. Printed: RMS of the deviation of rho [mm] and
alpha1 [deg] from the noise-free, delay-free run of the same law, mean over the seeds and the worst of them.
A row that ends in ", calibrated" is driven twice: first with the same things wrong and noise of its own, then
with the settings besides that ``abreast calibrate`` finds in the log of the first drive.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.angles import wrap
from hil.emulator.node import EmulatorState
from hil.judge.noise_free_orbit import noise_free_orbit
from hil.judge.run_data import Span
from hil.judge.true_states import TrueStates
from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.lockstep.run import make_nodes, run_lockstep
from hil.log.reader import read_log
from hil.nodes.node import Outgoing
from hil.replay.timing import timing_of
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.message_types import Truth
from hil.wire.messages import decode_as

PATIENT = ("controller.max_age_s=1.5", "estimator.coast_after_s=1.5", "estimator.lost_after_s=2.5")
"""For 0.8 s of latency: what is that old still counts as fresh, and the estimator waits for more."""

ROWS: Mapping[str, Sequence[str]] = {
    "as shipped": (),
    "commands truncated": ("controller.v_resolution=0", "controller.u_resolution=0"),
    "robot takes any value": (
        *("controller.v_resolution=0", "controller.u_resolution=0"),
        *("robot.v_resolution=0", "robot.u_resolution=0"),
    ),
    "no noise": (
        *("mocap.sigma_position=0", "mocap.sigma_heading=0"),
        *("robot.odometry_sigma_v=0", "robot.odometry_sigma_u=0"),
    ),
    "quicker leader assumed": ("estimator.turn_bandwidth=2",),
    "no lag predicted": ("controller.lag_s=0",),
    "transport assumed 30 ms long": ("controller.transport_s=0.03",),
    "stamps 30 ms late": ("mocap.clock_offset_s=0.03",),
    "stamps 30 ms early": ("mocap.clock_offset_s=-0.03",),
    "stamps 30 ms late, clock estimated": (
        *("mocap.clock_offset_s=0.03", "estimator.clock=estimated"),
        "estimator.transport_latency_s=0.03",
    ),
    "way unknown, clock estimated": ("mocap.clock_offset_s=0.03", "estimator.clock=estimated"),
    "lag assumed 50 ms": ("controller.lag_s=0.05",),
    "odometry stamped 30 ms late": ("robot.odometry_delay_s=0.03",),
    "lag assumed 50 ms, stamps late": ("controller.lag_s=0.05", "mocap.clock_offset_s=0.03"),
    **{
        f"latency 0.8 s, lag {lag:g} s": (
            *("mocap.latency_s=0.8", f"robot.lag_s={lag}", f"controller.lag_s={lag}"),
            *PATIENT,
        )
        for lag in (0.05, 0.1, 0.15)
    },
}

CALIBRATED = ", calibrated"
WRONG = (
    *("no lag predicted", "transport assumed 30 ms long", "stamps 30 ms late", "stamps 30 ms early"),
    *("way unknown, clock estimated", "lag assumed 50 ms", "odometry stamped 30 ms late"),
    "lag assumed 50 ms, stamps late",
)
"""Rows with a wrong idea of the timing, which one log puts right."""

ALL_ROWS = (*ROWS, *(f"{row}{CALIBRATED}" for row in WRONG))
OTHER_SEEDS = 1000


@dataclass(frozen=True)
class Deviation:
    """RMS deviation from the noise-free orbit: rho [m], alpha1 [rad]."""

    rho: float
    alpha1: float


def drive(overrides: Sequence[str], duration: float) -> Deviation:
    """Deviation of one run, judged in its second half; nan for a run that broke down."""
    scenario = load_scenario("turtlebot3", [f"run.duration_s={duration}", *overrides])
    truths: list[bytes] = []

    def record(message: Outgoing, now_ns: int) -> None:
        if message.topic == topics.TRUTH:
            truths.append(message.payload)

    lockstep = Lockstep(make_nodes(scenario), record)
    since_ns = None
    while since_ns is None:
        lockstep.run_until(lockstep.now_ns + 10_000_000)
        state = lockstep.state_of("emulator")
        assert isinstance(state, EmulatorState)
        since_ns = state.motion_since_ns
        if lockstep.now_ns > EPOCH_NS + 20_000_000_000:
            return Deviation(math.nan, math.nan)
    end_ns = since_ns + round(duration * 1e9)
    lockstep.run_until(end_ns)
    truth = TrueStates.of([decode_as(payload, Truth) for payload in truths])
    orbit = noise_free_orbit(scenario, truth, Span(since_ns, end_ns))
    if orbit is None:
        return Deviation(math.nan, math.nan)
    judged = truth.capture_ns >= (since_ns + end_ns) // 2
    rho, alpha1, _ = orbit.at(truth.capture_ns[judged])
    off_rho, off_alpha1 = truth.rho[judged] - rho, wrap(truth.alpha1[judged] - alpha1)
    return Deviation(math.sqrt(np.mean(off_rho**2)), math.sqrt(np.mean(off_alpha1**2)))


def overrides_of(row: str, seed: int, duration: float) -> list[str]:
    """Settings of a row, with those that a calibration finds where it asks for one."""
    given = list(ROWS[row.removesuffix(CALIBRATED)])
    if row in ROWS:
        return given
    noise = f"run.seed={OTHER_SEEDS + seed}"
    scenario = load_scenario("turtlebot3", [f"run.duration_s={duration}", *given, noise])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "first.mcap"
        run_lockstep(scenario, path)
        found = timing_of(read_log(path), scenario).settings(scenario)
    return [*given, *(f"{key}={value}" for key, value in found.items())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of: {', '.join(ALL_ROWS)}")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--duration", type=float, default=30.0)
    given = parser.parse_args()
    if unknown := [row for row in given.rows if row not in ALL_ROWS]:
        parser.error(f"unknown row {unknown[0]!r}, expected some of: {', '.join(ALL_ROWS)}")
    print(f"{given.seeds} seeds of {given.duration:g} s{'':33} rho mean  worst  alpha1 mean  worst")
    for row in given.rows or ALL_ROWS:
        runs = [
            drive([*overrides_of(row, seed, given.duration), f"run.seed={seed}"], given.duration)
            for seed in range(1, given.seeds + 1)
        ]
        rho, alpha1 = np.array([(1e3 * run.rho, math.degrees(run.alpha1)) for run in runs]).T
        means = f"{rho.mean():8.2f} {rho.max():6.2f} {alpha1.mean():12.2f} {alpha1.max():6.2f}"
        print(f"{row:48} {means}", flush=True)


if __name__ == "__main__":
    main()
