from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.consistency.cramer_rao import TruePath, cramer_rao
from estimation.filters.belief import Model
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise
from formation.angles import wrap
from hil.judge.columns import Columns, columns_of
from hil.judge.estimation import judge_estimation
from hil.judge.run_data import RunData, run_data_of_log
from hil.log.reader import Log


def parts(run_data: RunData, part: str) -> dict[str, float]:
    found = judge_estimation(run_data, columns_of(run_data))[part]
    assert isinstance(found, dict)
    return found


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.05, 0.05), st.floats(-3.0, 3.0))
def test_a_constant_offset_is_the_rmse(exact_run_data: RunData, offset: float, turn: float) -> None:
    estimates = [
        replace(each, v1=each.v1 + offset, alpha1=float(wrap(each.alpha1 + turn)))
        for each in exact_run_data.estimates
    ]
    run_data = replace(exact_run_data, estimates=estimates)
    for part in ("rmse", "max"):
        found = parts(run_data, part)
        assert found["v1"] == pytest.approx(abs(offset), abs=1e-12)
        assert found["alpha1"] == pytest.approx(abs(turn), abs=1e-12)
        assert found["u1"] == pytest.approx(0.0, abs=1e-12)


def test_coverage_is_the_share_within_three_deviations(exact_run_data: RunData) -> None:
    # The standard deviation of v1 is 1 mm/s; a quarter of the errors lie just outside of three of them.
    estimates = [
        replace(each, v1=each.v1 + (0.0031 if number % 4 == 0 else -0.0029))
        for number, each in enumerate(exact_run_data.estimates)
    ]
    found = parts(replace(exact_run_data, estimates=estimates), "coverage_3sigma")
    assert found["v1"] == pytest.approx(0.75, abs=0.01)
    assert found["alpha1"] == 1.0


def test_estimates_between_truths_are_compared_with_what_lies_between(exact_run_data: RunData) -> None:
    sparse = replace(exact_run_data, truth=exact_run_data.truth[::6])
    assert parts(sparse, "rmse")["v1"] == pytest.approx(0.0, abs=1e-12)
    # A chord between two truths 0.1 s apart leaves the true circle by rho_path * (1 - cos(0.015)).
    assert parts(sparse, "max")["alpha1"] < 1e-3


def _path(columns: Columns, measured: list[int]) -> TruePath:
    truth = columns.truth
    heading = truth.leader[:, 2]
    return TruePath(
        capture_ns=truth.capture_ns,
        leader=np.column_stack(
            [truth.leader[:, :2], truth.v1 * np.cos(heading), truth.v1 * np.sin(heading), truth.u1]
        ),
        follower_pose=truth.follower,
        follower_motion=np.column_stack([truth.v2, truth.u2]),
        measured=np.isin(truth.capture_ns, measured),
    )


def test_efficiency_is_against_the_whole_bound(short_log: Log) -> None:
    """Short cuts (start shortly before, look at some samples) change nothing that one would notice."""
    run_data = run_data_of_log(short_log)
    columns, given = columns_of(run_data), run_data.scenario
    assert run_data.frames is not None
    limits = LeaderLimits(given.leader.v_eps, given.leader.k_v, given.leader.k_u)
    model = Model(FrontEnd.WORLD, limits, ProcessNoise.by_rule(limits, given.estimator.turn_bandwidth))
    bounds = cramer_rao(
        _path(columns, list(run_data.frames.captures_ns)),
        model,
        PoseNoise(given.mocap.sigma_position, given.mocap.sigma_heading),
        given.robot.odometry_sigma_v,
        given.robot.odometry_sigma_u,
    )
    rows = np.isin(columns.truth.capture_ns, columns.samples.capture_ns)
    rmse, efficiency = parts(run_data, "rmse"), parts(run_data, "efficiency")
    for name, bound in bounds.items():
        best = math.sqrt(float(np.mean(bound[rows] ** 2)))
        assert efficiency[name] == pytest.approx(rmse[name] / best, rel=0.005)


def test_where_the_truth_is_known_for_a_part_only_that_part_is_judged(exact_run_data: RunData) -> None:
    """The larger errors lie where nobody knows: neither the worst nor the mean may show them, nor be lost."""
    columns = columns_of(exact_run_data)
    count = len(columns.samples.capture_ns)
    known = np.arange(count) < count // 2
    v1 = columns.true.v1 + np.where(np.arange(count) % 2 == 0, 0.002, -0.004)
    v1[~known] += 9.0
    samples = replace(columns.samples, seen=replace(columns.samples.seen, v1=v1))
    true = replace(columns.true, v1=np.where(known, columns.true.v1, math.nan))
    found = judge_estimation(exact_run_data, replace(columns, samples=samples, true=true))
    worst, rmse, share = found["max"], found["rmse"], found["coverage_3sigma"]
    assert isinstance(worst, dict)
    assert isinstance(rmse, dict)
    assert isinstance(share, dict)
    assert worst["v1"] == pytest.approx(0.004, abs=1e-12)
    assert rmse["v1"] == pytest.approx(math.sqrt(0.5 * (0.002**2 + 0.004**2)), rel=1e-2)
    assert share["v1"] == pytest.approx(0.5, abs=0.02)
    unknown = replace(columns.true, v1=np.full(count, math.nan))
    nothing = judge_estimation(exact_run_data, replace(columns, true=unknown))["max"]
    assert isinstance(nothing, dict)
    assert "v1" not in nothing
    assert "alpha1" in nothing
