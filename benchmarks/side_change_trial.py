"""Random trials of changing sides: starts, turns of the leader and moments of change drawn from a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from controllers.laws import Gains
from controllers.limits import Limits
from controllers.side_change import CORRECTION
from controllers.side_change_run import LONGEST_STEP, run_with_changes
from controllers.station_keeper import StationKeeper
from formation.leader import Table
from formation.pose import Pose
from formation.shape import Shape, follower_pose
from formation.spacing import Spacing
from formation.station import ABREAST, Side

_WANDERING, _WHOLE, _KNOTS = 60.0, 120.0, 16


@dataclass(frozen=True, slots=True)
class Setting:
    """Gains, limits and leader speed [m/s] of an experiment of the paper."""

    name: str
    gains: Gains
    limits: Limits
    v1: float


@dataclass(frozen=True, slots=True)
class Result:
    """Least distance [rho_0], and whether the pair is within 1 % and 0.01 rad of a station at the end."""

    nearest: float
    settled: bool


SETTINGS = (
    Setting("fig2", Gains(1.0, 2.0, Spacing(0.5, 2.0)), Limits(1.5, 2.84), 0.5),
    Setting("turtlebot3", Gains(1.5, 2.0, Spacing(0.2, 20.0)), Limits(0.22, 2.84), 0.08),
)


def random_run(setting: Setting, seed: int, *, knows_turn: bool, share: float = CORRECTION) -> Result:
    """Run number ``seed`` of a setting.

    It starts near the station on the right. The leader's turn rate wanders at random within ``share`` of
    v1 / rho_0 and ends straight; one to five orders to change sides fall at any time of the wandering. They
    are taken whatever the share.
    """
    random = np.random.default_rng([seed, int(knows_turn)])
    rho_0, v1 = setting.gains.spacing.rho_0, setting.v1
    unit = rho_0 / v1
    knots = np.linspace(0.0, _WANDERING * unit, _KNOTS)
    turns = random.uniform(-1.0, 1.0, _KNOTS) * share * v1 / rho_0
    turns[-1] = 0.0
    moments = np.sort(random.uniform(0.0, _WANDERING * unit, random.integers(1, 6)))
    start = Shape(
        rho_0 * random.uniform(0.8, 1.5),
        ABREAST.alpha1 + random.uniform(-0.5, 0.5),
        ABREAST.alpha2 + random.uniform(-0.5, 0.5),
    )
    leader = Pose(0.0, 0.0, random.uniform(-math.pi, math.pi))
    run = run_with_changes(
        leader,
        follower_pose(start, leader),
        Table(knots.tolist(), [v1] * _KNOTS, turns.tolist()),
        StationKeeper(setting.gains, setting.limits, knows_turn=knows_turn, may_change=True),
        list(zip(moments.tolist(), cycle((Side.LEFT, Side.RIGHT)), strict=False)),
        np.arange(0.0, _WHOLE * unit, LONGEST_STEP),
    )
    off = abs(run.rho[-1] / rho_0 - 1.0) < 0.01
    off &= abs(math.cos(run.alpha1[-1])) < 0.01 and abs(math.cos(run.alpha2[-1])) < 0.01
    return Result(float(run.rho.min()) / rho_0, bool(off and run.alpha1[-1] * run.alpha2[-1] < 0.0))
