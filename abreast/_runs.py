"""Runs and replays: their verdict, and what was estimated, true and commanded, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abreast._estimates import Estimates, estimates_of
from formation.angles import FloatArray
from hil.judge.run_data import RunData
from hil.judge.true_states import Stamps, TrueStates
from hil.replay.pose_tracks import told_by
from hil.wire.messages import to_ns

_S = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true states at n times, those of the estimates: arrays of shape (n,), NaN where not known.

    ``leader``, ``follower`` (n, 3): x, y [m], theta [rad]. All else as in :class:`abreast.Estimates`;
    ``v2`` [m/s], ``u2`` [rad/s]: what the follower really drives.
    """

    t: FloatArray
    leader: FloatArray
    follower: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    alpha2: FloatArray
    rho_dot: FloatArray
    alpha2_dot: FloatArray
    v1: FloatArray
    u1: FloatArray
    v2: FloatArray
    u2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """The m commands to a follower: arrays of shape (m,).

    ``t`` [s]: when it was issued, ``t_capture`` [s] the capture that it rests on, by the clock of the run.
    ``v2`` [m/s], ``u2`` [rad/s]: what was sent, ``v2_wanted``, ``u2_wanted`` what the law asked for.
    ``saturated``: whether a limit changed it. ``reason``: why the robot was stopped, empty if it was not.
    """

    t: FloatArray
    t_capture: FloatArray
    v2: FloatArray
    u2: FloatArray
    v2_wanted: FloatArray
    u2_wanted: FloatArray
    saturated: NDArray[np.bool_]
    reason: NDArray[np.str_]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What came of a run or a replay.

    ``summary``: the JSON of ``abreast run --json`` and ``abreast replay --json``. ``estimates``: one row for
    each that was made. ``truth``: the true states at the same times. ``commands``: to the follower. Times
    count from when the leader set off; in imported recordings they are the source's own.
    ``pairs``: of a chain, a run for each follower with its own part of the summary; the arrays of the chain
    are those of its first follower. Empty for a pair.

    >>> import abreast, numpy as np
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 4.0})
    >>> run = abreast.run_lockstep(scenario, seed=3)
    >>> good = run.estimates.status == "tracking"
    >>> error = run.estimates.v1[good] - run.truth.v1[good]
    >>> bool(np.sqrt(np.nanmean(error**2)) < 0.01)
    True
    """

    summary: Mapping[str, Any]
    estimates: Estimates
    truth: Truth
    commands: Commands
    pairs: tuple[Run, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The summary."""
        return dict(self.summary)


def run_of(summary: Mapping[str, Any], runs: Sequence[RunData]) -> Run:
    """Run with a summary, of the data of its pair or of all pairs of its chain."""
    pairs = summary.get("pairs")
    if pairs is None:
        return _run_of_pair(summary, runs[0])
    followed = tuple(_run_of_pair(part, run_data) for part, run_data in zip(pairs, runs, strict=True))
    first = followed[0]
    return Run(summary, first.estimates, first.truth, first.commands, followed)


def _run_of_pair(summary: Mapping[str, Any], run_data: RunData) -> Run:
    zero_ns = run_data.zero_ns
    capture_ns = np.array([to_ns(each.header.stamp) for each in run_data.estimates], dtype=np.int64)
    t = _seconds(capture_ns, zero_ns)
    return Run(
        summary,
        estimates_of(t, list(map(told_by, run_data.estimates))),
        _truth(t, TrueStates.of(run_data.truth).at(capture_ns)),
        _commands(run_data),
    )


def _truth(t: FloatArray, states: TrueStates) -> Truth:
    return Truth(
        t=t,
        leader=states.leader,
        follower=states.follower,
        rho=states.rho,
        alpha1=states.alpha1,
        alpha2=states.alpha2,
        rho_dot=states.rho_dot,
        alpha2_dot=states.alpha2_dot,
        v1=states.v1,
        u1=states.u1,
        v2=states.v2,
        u2=states.u2,
    )


def _commands(run_data: RunData) -> Commands:
    given = run_data.commands
    moments = np.array([(to_ns(c.header.stamp), to_ns(c.capture)) for c in given], dtype=np.int64).reshape(
        -1, 2
    )
    numbers = np.array([(c.v2, c.u2, c.v2_wanted, c.u2_wanted) for c in given], dtype=np.float64).reshape(
        -1, 4
    )
    v2, u2, v2_wanted, u2_wanted = (np.ascontiguousarray(column) for column in numbers.T)
    return Commands(
        t=_seconds(moments[:, 0], run_data.zero_ns),
        t_capture=_seconds(moments[:, 1], run_data.zero_ns),
        v2=v2,
        u2=u2,
        v2_wanted=v2_wanted,
        u2_wanted=u2_wanted,
        saturated=np.array([c.saturated for c in given], dtype=np.bool_),
        reason=np.array([c.stop for c in given], dtype=np.str_),
    )


def _seconds(moments_ns: Stamps, zero_ns: int) -> FloatArray:
    return np.asarray((moments_ns - zero_ns) * _S, dtype=np.float64)
