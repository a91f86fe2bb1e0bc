"""Tracks in arrays against a recording of the same rows, and what is said of arrays that are none."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abreast
from hil.log.reader import read_log
from hil.recordings.column_map import load_column_map
from hil.recordings.csv_import import import_csv
from hil.replay.rerun import replay
from hil.wire.messages import to_ns

N, RATE = 600, 120.0
SIGMAS = (3e-4, 3e-4, 3.5e-3)
MAP = """
[columns]
t = "t"
v2 = "v2"
u2 = "u2"
leader_x = "lx"
leader_y = "ly"
follower_x = "fx"
follower_y = "fy"
follower_theta = "ft"
[scenario]
base = "turtlebot3"
[scenario.estimator]
own_motion = "{own_motion}"
kind = "{estimator}"
"""


@pytest.fixture(scope="module")
def rows() -> dict[str, Any]:
    """A pair on a slow turn, the follower on the right, as a motion capture and wheels see it."""
    random = np.random.default_rng(5)
    t = 40.0 + np.arange(N) / RATE
    theta = 0.4 * (t - 40.0)
    way = np.column_stack([np.sin(theta), 1.0 - np.cos(theta)])
    leader = 0.2 * way + random.normal(0.0, SIGMAS[:2], (N, 2))
    abreast_of = 0.2 * np.column_stack([np.sin(theta), -np.cos(theta)])
    follower = np.column_stack([0.2 * way + abreast_of, theta]) + random.normal(0.0, SIGMAS, (N, 3))
    v2, u2 = 0.16 + random.normal(0.0, 0.005, N), 0.4 + random.normal(0.0, 0.03, N)
    return {"t": t, "leader": leader, "follower": follower, "v2": v2, "u2": u2}


@pytest.mark.parametrize(
    ("own_motion", "estimator"),
    [("mocap", "ekf"), ("odometry", "ekf"), ("fused", "ukf"), ("odometry", "imm"), ("odometry", "smoother")],
)
def test_arrays_give_what_the_log_of_the_same_rows_gives(
    own_motion: str, estimator: str, rows: dict[str, Any], tmp_path: Path
) -> None:
    """Every number to the last bit: it is the same estimator, and rows are not shifted."""
    table = tmp_path / "rows.csv"
    with table.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t", "lx", "ly", "fx", "fy", "ft", "v2", "u2"])
        writer.writerows(np.column_stack(list(rows.values())).tolist())
    chart = tmp_path / "chart.toml"
    chart.write_text(MAP.format(own_motion=own_motion, estimator="ekf"), encoding="utf-8")
    import_csv(table, load_column_map(str(chart)), tmp_path / "rows.mcap")
    log = read_log(tmp_path / "rows.mcap")
    scenario = abreast.load_scenario(
        "turtlebot3", {"estimator.own_motion": own_motion, "estimator.kind": estimator}
    )
    by_stamp = {to_ns(each.header.stamp): each for each in replay(log, scenario).estimates}

    found = abreast.estimate(**rows, estimator=estimator, own_motion=own_motion)
    assert len(found) == N
    compared = 0
    for k, t in enumerate(rows["t"].tolist()):
        logged = by_stamp.get(round(t * 1e9))
        if logged is None:
            assert found.status[k] == "missing"
            continue
        compared += 1
        for name in (
            "rho",
            "alpha2",
            "rho_dot",
            "alpha2_dot",
            "v1",
            "alpha1",
            "u1",
            "bound_v1",
            "bound_alpha1",
        ):
            assert getattr(found, name)[k] == pytest.approx(
                getattr(logged, name), rel=0.0, abs=0.0, nan_ok=True
            )
        assert found.sd_v1[k] == math.sqrt(logged.covariance[12])
        assert found.reason[k] == logged.reason
    assert compared >= N - 1


def test_without_odometry_the_own_track_tells_the_motion(rows: dict[str, Any]) -> None:
    tracks = {name: rows[name] for name in ("t", "leader", "follower")}
    motion = {name: rows[name] for name in ("v2", "u2")}
    alone, told = abreast.estimate(**tracks), abreast.estimate(**tracks, **motion)
    told_by_track = abreast.estimate(**tracks, **motion, own_motion="mocap")
    assert np.array_equal(alone.v1, told_by_track.v1, equal_nan=True)
    assert not np.array_equal(alone.rho_dot, told.rho_dot, equal_nan=True)
    good = alone.status == "tracking"
    assert np.count_nonzero(good) > 0.8 * N
    assert float(np.sqrt(np.mean((alone.v1[good] - 0.08) ** 2))) < 0.004
    assert float(np.sqrt(np.mean((alone.alpha1[good] + 0.5 * math.pi) ** 2))) < 0.05


@pytest.mark.parametrize("own_motion", ["auto", "mocap"])
@pytest.mark.parametrize("k_v", [0.1, 2.0])
def test_robots_that_are_faster_than_their_scenario_says_are_followed(own_motion: str, k_v: float) -> None:
    """From the first row on at seven times the speed of a TurtleBot3, as robots of another kind may be."""
    t = np.arange(0.0, 3.0, 0.02)
    random, heading = np.random.default_rng(3), 0.3 * t
    follower = np.column_stack([5.0 * np.sin(heading), 5.0 * (1.0 - np.cos(heading)), heading])
    leader = follower[:, :2] + np.column_stack([0.1 * t, 0.5 + 0.0 * t])
    leader, follower = (a + 1e-4 * random.standard_normal(a.shape) for a in (leader, follower))
    scenario = abreast.load_scenario("turtlebot3", {"leader.k_v": k_v})
    found = abreast.estimate(t, leader, follower, scenario=scenario, own_motion=own_motion)
    late = t > 1.2
    assert np.all(found.status[late] == "tracking")
    assert np.abs(found.v1[late] - 1.56).max() < 0.06


def test_rows_that_were_not_seen_are_missing_and_nothing_is_shifted(rows: dict[str, Any]) -> None:
    leader, follower = rows["leader"].copy(), rows["follower"].copy()
    leader[200:230] = math.nan
    follower[300, 2] = math.nan
    found = abreast.estimate(rows["t"], leader, follower)
    gone = np.zeros(N, dtype=bool)
    gone[200:230] = gone[300] = True
    assert np.array_equal(found.t, rows["t"])
    assert np.array_equal(found.status == "missing", gone)
    assert np.array_equal(np.isnan(found.v1), gone)
    seen = np.hypot(*(rows["leader"] - rows["follower"][:, :2]).T)
    assert np.all(np.abs(found.rho - seen)[~gone] < 0.01)


def test_a_masked_row_was_not_seen(rows: dict[str, Any]) -> None:
    hidden = np.zeros((N, 2), dtype=bool)
    hidden[200:210] = True
    masked = abreast.estimate(**{**rows, "leader": np.ma.array(rows["leader"], mask=hidden)})
    missing = abreast.estimate(**{**rows, "leader": np.where(hidden, math.nan, rows["leader"])})
    assert np.array_equal(masked.v1, missing.v1, equal_nan=True)
    assert np.isnan(masked.v1[205])


def test_complex_numbers_are_refused(rows: dict[str, Any]) -> None:
    with pytest.raises(abreast.UsageError, match="leader is complex, expected real numbers"):
        abreast.estimate(**{**rows, "leader": rows["leader"] + 0j})


def test_a_row_that_is_refused_says_why(rows: dict[str, Any]) -> None:
    leader = rows["leader"].copy()
    leader[50] = rows["follower"][50, :2]
    found = abreast.estimate(rows["t"], leader, rows["follower"])
    assert found.status[50] == "missing"
    assert found.reason[50] == "same_place"


def test_times_may_count_from_anywhere(rows: dict[str, Any]) -> None:
    tracks = (rows["leader"], rows["follower"])
    whole = np.round(rows["t"] * 1e6) * 1e-6
    here = abreast.estimate(whole, *tracks)
    for shift in (-1000.0, 1.7e9):
        there = abreast.estimate(whole + shift, *tracks)
        good = here.status == "tracking"
        assert np.allclose(there.v1[good], here.v1[good], atol=1e-4)


BAD: list[tuple[dict[str, Any], str]] = [
    ({"t": np.zeros(N)}, r"t\[1\] is 0 after 0: expected times that increase"),
    ({"t": np.arange(N)[::-1]}, r"t\[1\] is 598 after 599"),
    ({"t": np.full(N, math.nan)}, r"t\[0\] is nan, expected a finite number"),
    ({"t": np.zeros((N, 2))}, r"t has shape \(600, 2\), expected \(n,\)"),
    ({"t": ["a"] * N}, "t is no array of numbers"),
    ({"t": 1e18 + 1e9 * np.arange(N)}, "expected seconds; are these milli- or nanoseconds"),
    ({"t": 1e-10 * np.arange(N)}, r"t\[1\] is less than a nanosecond after t\[0\]"),
    (
        {"t": 8.0 * np.arange(N)},
        r"rows are 8 s apart .* estimator.lost_after_s = 1 s; are these milliseconds",
    ),
    ({"leader": np.zeros((N, 3))}, r"leader has shape \(600, 3\), expected \(600, 2\): x, y"),
    ({"follower": np.zeros((N - 1, 3))}, r"follower has shape \(599, 3\), expected \(600, 3\)"),
    ({"leader": np.full((N, 2), math.inf)}, r"leader\[0\] is infinite; put nan"),
    ({"leader": np.full((N, 2), math.nan)}, "no row of 600 gives an estimate"),
    ({"v2": np.zeros(N)}, "v2 is given without u2"),
    ({"own_motion": "odometry"}, "own_motion is 'odometry', but there are no v2 and u2"),
    ({"estimator": "kalman"}, "estimator.kind is 'kalman'"),
    ({"scenario": "turtelbot3"}, "did you mean 'turtlebot3'"),
    ({"scenario": "chain5"}, r"it has a \[chain\]"),
]


@pytest.mark.parametrize(("changed", "said"), BAD, ids=[said[:30] for _, said in BAD])
def test_bad_input_is_told_in_one_line(changed: dict[str, Any], said: str, rows: dict[str, Any]) -> None:
    given: dict[str, Any] = {name: rows[name] for name in ("t", "leader", "follower")}
    with pytest.raises(abreast.UsageError, match=said) as error:
        abreast.estimate(**given | changed)
    assert "\n" not in str(error.value)


def test_headings_in_degrees_are_found_and_many_turns_in_radians_are_not(rows: dict[str, Any]) -> None:
    t, leader, follower = rows["t"], rows["leader"], rows["follower"]
    degrees = follower * (1.0, 1.0, math.degrees(1.0))
    with pytest.raises(abreast.UsageError, match="expected headings in radians"):
        abreast.estimate(t, leader, degrees)
    turned = follower + np.array([0.0, 0.0, 14.0 * math.pi])
    assert np.count_nonzero(abreast.estimate(t, leader, turned).status == "tracking") > 0.8 * N
