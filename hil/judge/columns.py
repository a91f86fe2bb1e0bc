"""Run data as arrays, and the estimates that are judged beside their truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import overload

import numpy as np
from numpy.typing import NDArray

from estimation.bounds.error_bounds import Perceived
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray
from hil.judge.mocap_truth import smoothed_truth
from hil.judge.run_data import RunData, Span, evaluation_span, run_span
from hil.judge.true_states import Stamps, TrueStates
from hil.nodes.controller_desk import STOPS
from hil.scenario.leader_model import follower_mount, leader_mount
from hil.wire.message_types import Command, LeaderEstimate
from hil.wire.messages import to_ns

_SEEN = ("rho", "alpha2", "rho_dot", "alpha2_dot", "v1", "alpha1", "v2", "u2")
_ESTIMATED = attrgetter(*_SEEN, "u1", "nis")
_BOUND_NAMES = ("bound_v1", "bound_alpha1", "bound_h")
_BOUNDS = attrgetter(*_BOUND_NAMES)


@dataclass(frozen=True, slots=True, eq=False)
class EstimateColumns:
    """Estimates as arrays of shape (n,), ``sd`` (n, 5) of the quantities in the order of the covariance.

    ``seen`` is what the bounds need of them; units and signs as in ``LeaderEstimate.msg``. ``bounds`` (n, 3):
    of v1, alpha1 and h as they were published, None for estimates that were not. ``computed_ns``: when each
    was, which is never before its capture, nor before the one in front of it; None if that is not known.
    """

    capture_ns: Stamps
    status: NDArray[np.int64]
    seen: Perceived
    u1: FloatArray
    nis: FloatArray
    sd: FloatArray
    bounds: FloatArray | None = None
    computed_ns: Stamps | None = None

    @staticmethod
    def of(estimates: Sequence[LeaderEstimate]) -> EstimateColumns:
        """Columns of messages, in their order."""
        columns = np.array(list(map(_ESTIMATED, estimates)), dtype=np.float64).reshape(-1, 10).T
        variances = np.array([e.covariance[::6] for e in estimates], dtype=np.float64).reshape(-1, 5)
        capture_ns = np.array([to_ns(e.header.stamp) for e in estimates], dtype=np.int64)
        computed_ns = np.array([to_ns(e.computed) for e in estimates], dtype=np.int64)
        return EstimateColumns(
            capture_ns=capture_ns,
            status=np.array([e.status for e in estimates], dtype=np.int64),
            seen=Perceived(*columns[:8]),
            u1=columns[8],
            nis=columns[9],
            sd=np.sqrt(np.maximum(variances, 0.0)),
            bounds=np.array(list(map(_BOUNDS, estimates)), dtype=np.float64).reshape(-1, 3),
            computed_ns=_in_order(capture_ns, computed_ns),
        )

    @staticmethod
    def of_rows(rows: NDArray[np.void]) -> EstimateColumns:
        """Columns of rows of :class:`hil.replay.kept_rows.EstimateRow`, deviations and bounds copied."""
        return EstimateColumns(
            capture_ns=rows["capture_ns"],
            status=rows["status"],
            seen=Perceived(*(rows[name] for name in _SEEN)),
            u1=rows["u1"],
            nis=rows["nis"],
            sd=np.sqrt(np.maximum(np.column_stack([rows[f"var_{name}"] for name in QUANTITIES]), 0.0)),
            bounds=np.column_stack([rows[name] for name in _BOUND_NAMES]),
            computed_ns=_in_order(rows["capture_ns"], rows["computed_ns"]),
        )

    def only(self, among: NDArray[np.bool_]) -> EstimateColumns:
        """The estimates in the given rows, as a view where none is left out in between."""
        if among.all():
            return self
        rows: NDArray[np.bool_] | slice = among
        places = np.flatnonzero(among)
        if len(places) and places[-1] - places[0] == len(places) - 1:
            rows = slice(int(places[0]), int(places[-1]) + 1)
        seen = Perceived(*(np.asarray(getattr(self.seen, name))[rows] for name in _SEEN))
        return EstimateColumns(
            capture_ns=self.capture_ns[rows],
            status=self.status[rows],
            seen=seen,
            u1=self.u1[rows],
            nis=self.nis[rows],
            sd=self.sd[rows],
            bounds=None if self.bounds is None else self.bounds[rows],
            computed_ns=None if self.computed_ns is None else self.computed_ns[rows],
        )

    @property
    def told_ns(self) -> Stamps:
        """When each was told: what an estimate says of itself holds from then on, not from its capture."""
        return self.capture_ns if self.computed_ns is None else self.computed_ns


def _in_order(capture_ns: Stamps, computed_ns: Stamps) -> Stamps:
    """Times of computation that go on as the estimates do; a clock that is set back does not."""
    return np.maximum.accumulate(np.maximum(capture_ns, computed_ns))


@dataclass(frozen=True, slots=True, eq=False)
class CommandColumns:
    """Commands as arrays of shape (n,): when issued, the capture behind them, what was sent, and flags.

    ``stop``: why the robot is stopped, empty while it drives. ``v2_wanted``: NaN if the law gave none.
    ``fresh``: the first command on a capture; later ones may rest on it as a late frame has changed it.
    """

    issued_ns: Stamps
    capture_ns: Stamps
    v2: FloatArray
    u2: FloatArray
    saturated: NDArray[np.bool_]
    stop: Sequence[str]
    stopped: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    v2_wanted: FloatArray

    @staticmethod
    def of(commands: Sequence[Command]) -> CommandColumns:
        """Columns of messages, in their order."""
        capture_ns = np.array([to_ns(c.capture) for c in commands], dtype=np.int64)
        fresh = np.array([c.fresh for c in commands], dtype=np.bool_)
        return CommandColumns(
            issued_ns=np.array([to_ns(c.header.stamp) for c in commands], dtype=np.int64),
            capture_ns=capture_ns,
            v2=np.array([c.v2 for c in commands], dtype=np.float64),
            u2=np.array([c.u2 for c in commands], dtype=np.float64),
            saturated=np.array([c.saturated for c in commands], dtype=np.bool_),
            stop=[c.stop for c in commands],
            stopped=np.array([bool(c.stop) for c in commands], dtype=np.bool_),
            fresh=_first_on_each(capture_ns, fresh),
            v2_wanted=np.array([c.v2_wanted for c in commands], dtype=np.float64),
        )

    @staticmethod
    def of_rows(rows: NDArray[np.void]) -> CommandColumns:
        """Columns of rows of :class:`hil.replay.kept_rows.CommandRow`."""
        reasons = ("", *STOPS)
        return CommandColumns(
            issued_ns=rows["issued_ns"],
            capture_ns=rows["capture_ns"],
            v2=rows["v2"],
            u2=rows["u2"],
            saturated=rows["saturated"],
            stop=_Words(rows["stop"], reasons),
            stopped=rows["stop"] != 0,
            fresh=_first_on_each(rows["capture_ns"], rows["fresh"]),
            v2_wanted=rows["v2_wanted"],
        )

    @property
    def stood(self) -> NDArray[np.bool_]:
        """Commands by which the robot was told to stand still, from its first drive on.

        Before that it waits: for the first estimate, in a chain for its predecessor. A robot that was never
        driven was told to stand by all of them.
        """
        drives = np.flatnonzero(~self.stopped)
        return self.stopped & (np.arange(len(self.stopped)) >= (drives[0] if len(drives) else 0))


class _Words(Sequence[str]):
    """Texts by their numbers."""

    def __init__(self, numbers: NDArray[np.int64], texts: Sequence[str]) -> None:
        self._numbers, self._texts = numbers, texts

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[str]: ...
    def __getitem__(self, place: int | slice) -> str | Sequence[str]:
        if isinstance(place, slice):
            return _Words(self._numbers[place], self._texts)
        return self._texts[int(self._numbers[place])]


def _first_on_each(capture_ns: Stamps, fresh: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the fresh commands are the first on their capture."""
    rows = np.flatnonzero(fresh)
    first = np.zeros(len(capture_ns), dtype=np.bool_)
    first[rows[np.unique(capture_ns[rows], return_index=True)[1]]] = True
    return first


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Run data as columns. ``samples``: the estimates that are judged; ``true``: the truth at each."""

    run: Span
    span: Span
    estimates: EstimateColumns
    commands: CommandColumns
    truth: TrueStates
    samples: EstimateColumns
    true: TrueStates


def columns_of(run_data: RunData) -> Columns:
    """Columns of run data. Samples are the estimates of :func:`judged_rows`."""
    run, span = run_span(run_data), evaluation_span(run_data)
    estimates, truth = estimate_columns(run_data), true_states(run_data)
    samples = estimates.only(judged_rows(estimates, span))
    return Columns(
        run=run,
        span=span,
        estimates=estimates,
        commands=command_columns(run_data),
        truth=truth,
        samples=samples,
        true=truth.at(samples.capture_ns),
    )


def judged_rows(estimates: EstimateColumns, span: Span) -> NDArray[np.bool_]:
    """Which estimates are judged: those marked TRACKING whose capture lies in the evaluation."""
    tracking: NDArray[np.bool_] = estimates.status == Status.TRACKING
    return inside(estimates.capture_ns, span) & tracking


def estimate_columns(run_data: RunData) -> EstimateColumns:
    """Columns of a run's estimates."""
    kept = run_data.kept
    return EstimateColumns.of(run_data.estimates) if kept is None else EstimateColumns.of_rows(kept.estimates)


def command_columns(run_data: RunData) -> CommandColumns:
    """Columns of a run's commands."""
    kept = run_data.kept
    return CommandColumns.of(run_data.commands) if kept is None else CommandColumns.of_rows(kept.commands)


def true_states(run_data: RunData) -> TrueStates:
    """Columns of a run's truth, of the robots even where the log's is of the bodies on them.

    Where nobody knows the truth of a run they are those of the smoothed tracks of the motion capture.
    """
    kept, scenario = run_data.kept, run_data.scenario
    if run_data.tracks is not None:
        return smoothed_truth(run_data.tracks, scenario)
    states = TrueStates.of(run_data.truth) if kept is None else TrueStates.of_rows(kept.truths)
    if not run_data.truth_of_bodies:
        return states
    return states.of_robots(leader_mount(scenario), follower_mount(scenario))


def inside(moments_ns: Stamps, span: Span) -> NDArray[np.bool_]:
    """Which moments lie within a span, its ends included."""
    return (moments_ns >= span.from_ns) & (moments_ns <= span.to_ns)
