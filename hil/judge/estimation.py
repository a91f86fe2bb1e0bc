"""How good the estimates were: errors against the truth, and against what anybody could have known."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from estimation.consistency.cramer_rao import TruePath, cramer_rao
from estimation.filters.belief import Model
from estimation.models.measurement import FrontEnd, PoseNoise
from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray, wrap
from hil.judge.columns import Columns, EstimateColumns, inside
from hil.judge.consistency import judge_nees
from hil.judge.run_data import RunData, Span
from hil.judge.true_states import Stamps, TrueStates, run_of
from hil.scenario.leader_model import leader_limits, pose_noise, process_noise
from hil.scenario.schema import Scenario

WARM_UP_NS = 3_000_000_000
"""What the Cramer-Rao recursion is given to forget its start: several times its longest memory."""

EVERY = 8
"""Of so many samples the bound is looked at in one: it moves as slowly as the leader."""

_SAME_NS = 2_000_000


def judge_estimation(run_data: RunData, columns: Columns) -> dict[str, object]:
    """The ``estimation`` part of a summary.

    ``settle_s``: from the start of the run (the leader sets off, or the first capture) to the capture of the
    first estimate that says TRACKING. ``nis_mean``: over the samples whose NIS is finite. ``rmse``, ``max``
    and ``coverage_3sigma`` (the share of errors within three of the estimate's own standard deviations): over
    the samples at which the quantity's truth is known. ``max_at_s``: capture time of the largest error, in
    seconds of the run. ``efficiency``: RMSE over the root mean square of the posterior Cramer-Rao bound at
    these samples; only for the world front end, whose noise it is about.
    ``nees``, ``nees_limits``: see :func:`hil.judge.consistency.judge_nees`. Where smoothed tracks stand in
    for the truth, which err as much as good estimates, there are neither these nor coverage nor efficiency.
    """
    samples, estimates = columns.samples, columns.estimates
    nis = samples.nis[np.isfinite(samples.nis)]
    judged = int(np.count_nonzero(inside(estimates.capture_ns, columns.span)))
    errors = estimate_errors(columns)
    rmse = {name: _rms(error) for name, error in errors.items()}
    told: dict[str, object] = {
        "evaluated_from_s": (columns.span.from_ns - run_data.zero_ns) / 1e9,
        "samples": len(samples.capture_ns),
        "untracked": judged - len(samples.capture_ns),
        "settle_s": _settle(columns),
        "nis_mean": float(nis.mean()) if len(nis) else None,
        "rmse": rmse,
        **_largest(run_data, columns, errors),
    }
    if run_data.tracks is not None:
        return told
    return {
        **told,
        "efficiency": _efficiency(run_data, columns, rmse),
        "coverage_3sigma": _coverage(columns, errors),
        **judge_nees(samples, errors),
    }


def estimate_errors(columns: Columns) -> dict[str, FloatArray]:
    """Errors of the judged samples, as :func:`errors_at`."""
    return errors_at(columns.samples, columns.true)


def errors_at(estimates: EstimateColumns, true: TrueStates) -> dict[str, FloatArray]:
    """Estimate minus truth of every estimate, by quantity, NaN where the truth is not known.

    Quantities whose truth is known nowhere are left out.
    """
    seen = estimates.seen
    errors = {
        "rho_dot": seen.rho_dot - true.rho_dot,
        "alpha2_dot": seen.alpha2_dot - true.alpha2_dot,
        "v1": seen.v1 - true.v1,
        "alpha1": wrap(seen.alpha1 - true.alpha1),
        "u1": estimates.u1 - true.u1,
    }
    return {name: error for name, error in errors.items() if np.any(np.isfinite(error))}


def _largest(
    run_data: RunData, columns: Columns, errors: Mapping[str, FloatArray]
) -> dict[str, dict[str, float]]:
    """The largest errors, and when they were."""
    rows = {name: int(np.nanargmax(np.abs(error))) for name, error in errors.items()}
    at_ns = columns.samples.capture_ns
    return {
        "max": {name: float(abs(errors[name][row])) for name, row in rows.items()},
        "max_at_s": {name: (int(at_ns[row]) - run_data.zero_ns) / 1e9 for name, row in rows.items()},
    }


def _settle(columns: Columns) -> float | None:
    since, estimates = columns.run.from_ns, columns.estimates
    settled = estimates.capture_ns[(estimates.status == Status.TRACKING) & (estimates.capture_ns >= since)]
    return float(settled.min() - since) / 1e9 if len(settled) else None


def _rms(error: FloatArray) -> float:
    return math.sqrt(float(np.nanmean(error * error)))


def _coverage(columns: Columns, errors: Mapping[str, FloatArray]) -> dict[str, float]:
    shares: dict[str, float] = {}
    for name, error in errors.items():
        sd = columns.samples.sd[:, QUANTITIES.index(name)]
        known = np.isfinite(error)
        shares[name] = float(np.mean(np.abs(error[known]) <= 3.0 * sd[known]))
    return shares


def _efficiency(run_data: RunData, columns: Columns, rmse: Mapping[str, float]) -> dict[str, float]:
    given = run_data.scenario
    emulated = run_data.motion_since_ns is not None
    if run_data.frames is None or not rmse:
        return {}
    received = np.asarray(run_data.frames.captures_ns, dtype=np.int64)
    bounds = least_deviations(given, columns, received, emulated=emulated)
    sizes = {name: bound[np.isfinite(bound)] for name, bound in bounds.items()}
    best = {name: _rms(bound) if len(bound) else 0.0 for name, bound in sizes.items()}
    return {name: rmse[name] / best[name] for name in rmse if best.get(name, 0.0) > 0.0}


def least_deviations(
    scenario: Scenario, columns: Columns, received_ns: Stamps, *, emulated: bool
) -> dict[str, FloatArray]:
    """Posterior Cramer-Rao bound by quantity, at one in :data:`EVERY` samples of the columns.

    ``received_ns``: captures whose frames arrived. ``emulated``: whether the noise is the emulator's. Empty
    where there is no such bound: off the world front end, without noise, or where the truth is not all known.
    """
    noise, sd_v2, sd_u2 = _noise(scenario, emulated=emulated)
    if scenario.estimator.front_end != "world" or noise.position <= 0.0:
        return {}
    truth = columns.truth
    within = inside(truth.capture_ns, Span(columns.span.from_ns - WARM_UP_NS, columns.span.to_ns))
    near: NDArray[np.bool_] | slice = slice(None) if np.all(within) else within
    heading, v1 = truth.leader[near, 2], truth.v1[near]
    velocity = (v1 * np.cos(heading), v1 * np.sin(heading))
    leader = np.column_stack([truth.leader[near, :2], *velocity, truth.u1[near]])
    motion = np.column_stack([truth.v2[near], truth.u2[near]])
    if not np.all(np.isfinite(leader)) or not np.all(np.isfinite(motion)):
        return {}
    moments = truth.capture_ns[near]
    measured = _marked(moments, received_ns)
    path = TruePath(moments, leader, truth.follower[near], motion, measured)
    wanted = np.zeros(len(moments), dtype=np.bool_)
    wanted[_nearest(moments, columns.samples.capture_ns)[::EVERY]] = True
    return cramer_rao(path, _model(scenario), noise, sd_v2, sd_u2, wanted)


def _nearest(moments_ns: Stamps, wanted_ns: Stamps) -> NDArray[np.int64]:
    """Rows of the increasing moments that are within 2 ms of wanted ones: a clock is estimated no better."""
    if (run := run_of(moments_ns, wanted_ns)) is not None:
        return np.arange(run.start, run.stop)
    after = np.minimum(np.searchsorted(moments_ns, wanted_ns), len(moments_ns) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(moments_ns[after] - wanted_ns) <= np.abs(moments_ns[before] - wanted_ns)
    rows = np.where(nearer, after, before)
    is_found = np.zeros(len(moments_ns), dtype=np.bool_)
    is_found[rows[np.abs(moments_ns[rows] - wanted_ns) <= _SAME_NS]] = True
    return np.flatnonzero(is_found)


def _marked(moments_ns: Stamps, others_ns: Stamps) -> NDArray[np.bool_]:
    """Which of the increasing moments are among others, in whatever order these are."""
    among = np.zeros(len(moments_ns), dtype=np.bool_)
    if len(moments_ns):
        others_ns = others_ns[(others_ns >= moments_ns[0]) & (others_ns <= moments_ns[-1])]
        if (run := run_of(moments_ns, others_ns)) is not None:
            among[run] = True
            return among
        rows = np.searchsorted(moments_ns, others_ns)
        among[rows[moments_ns[rows] == others_ns]] = True
    return among


def _model(scenario: Scenario) -> Model:
    return Model(FrontEnd.WORLD, leader_limits(scenario), process_noise(scenario))


def _noise(scenario: Scenario, *, emulated: bool) -> tuple[PoseNoise, float, float]:
    """Noise of poses, v2 and u2: what the emulator put in, elsewhere what the estimator assumes."""
    if emulated:
        mocap, robot = scenario.mocap, scenario.robot
        return (
            PoseNoise(mocap.sigma_position, mocap.sigma_heading),
            robot.odometry_sigma_v,
            robot.odometry_sigma_u,
        )
    given = scenario.estimator
    return pose_noise(scenario), given.sigma_v2, given.sigma_u2
