"""A run in which the leader turns back says so, and ends confidence; it is judged by the way it travels."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from estimation.filters.belief import Model
from estimation.filters.filter import Kind, filter_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise, measure_world
from estimation.tracking.track_point import GATED, USED, TrackPoint, begun
from estimation.tracking.tracker import Status
from estimation.tracking.travel_watch import NO_TRAVEL
from formation.pose import Pose
from hil.judge.columns import columns_of, inside
from hil.judge.estimation import errors_at
from hil.judge.run_data import Span, run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.nodes.leader_findings import leader_findings, limits_findings
from hil.scenario.files import load_scenario

SECOND_NS = 1_000_000_000
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)


def test_a_leader_that_turned_back_is_spoken_of_for_a_while() -> None:
    assert not leader_findings(NO_TRAVEL, 0)
    turned = NO_TRAVEL._replace(turned_ns=10 * SECOND_NS)
    assert "direction of travel" in leader_findings(turned, 11 * SECOND_NS)["cusp"]
    assert not leader_findings(turned, 13 * SECOND_NS)


def seen_driving(v1: float, u1: float, sd: float = 1e-3) -> TrackPoint:
    """A settled track's newest point, of a leader that drives aslant."""
    rest = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    seen = measure_world(SECOND_NS, (1.0, 2.0), Pose(0.5, 2.0, 0.0), PoseNoise(3e-4, 3.5e-3), rest)
    point = begun(seen, filter_of(Kind.EKF, Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))))
    vx, vy = 0.6 * v1, 0.8 * v1
    belief = point.belief._replace(vx=vx, vy=vy, u=u1, vx_vx=sd * sd, vx_vy=0.0, vy_vy=sd * sd, u_u=0.01**2)
    return point._replace(belief=belief, verdict=USED, settled=True)


@pytest.mark.parametrize(
    ("v1", "u1", "said"),
    [
        (0.2, 0.0, ["it drives at 0.2 m/s, expected up to leader.k_v = 0.1"]),
        (0.08, -1.1, ["it turns at 1.1 rad/s, expected up to leader.k_u = 0.7"]),
        (0.2, 1.1, ["it drives at 0.2 m/s", "it turns at 1.1 rad/s"]),
        (0.1, 0.7, []),
        (0.112, 0.78, []),
    ],
)
def test_a_leader_beyond_what_is_told_of_it_is_named(v1: float, u1: float, said: list[str]) -> None:
    found = limits_findings(seen_driving(v1, u1), LIMITS)
    assert set(found) == ({"leader_limits"} if said else set())
    for each in said:
        assert each in found["leader_limits"]


def test_what_is_not_sure_is_no_broken_limit() -> None:
    fast = seen_driving(0.2, 0.0)
    assert limits_findings(fast, LIMITS)
    for unsure in (
        seen_driving(0.2, 0.0, sd=0.03),
        fast._replace(settled=False),
        fast._replace(verdict=GATED),
    ):
        assert not limits_findings(unsure, LIMITS)


@pytest.mark.parametrize("takes_s", [0.01, 1.0])
def test_a_cusp_ends_confidence_and_is_named(takes_s: float, tmp_path: Path) -> None:
    table = f"t=[0.0, 3.0, {3.0 + takes_s}, 9.0], v=[-0.1, -0.1, 0.1, 0.1], u=[0.2, 0.2, 0.2, 0.2]"
    scenario = load_scenario(
        "turtlebot3",
        [f'leader.program={{kind="table", {table}}}', "run.duration_s=6.0", "run.evaluate_from_s=1.0"],
    )
    run_lockstep(scenario, tmp_path / "run.mcap")
    run_data = run_data_of_log(read_log(tmp_path / "run.mcap"))
    summary, columns = summarise(run_data), columns_of(run_data)
    assert "cusp" in [each["name"] for each in summary["findings"]]
    # The truth is that of the direction of travel, and so are the estimates, before and after.
    assert np.all(columns.truth.v1 >= 0.0)
    assert summary["estimation"]["rmse"]["alpha1"] < 0.15
    assert summary["estimation"]["rmse"]["v1"] < 0.01
    assert "orbit_deviation_rms" not in summary["formation"]
    estimates = columns.estimates
    begun = run_data.zero_ns + 3 * SECOND_NS
    turning = inside(estimates.capture_ns, Span(begun, begun + SECOND_NS + round(takes_s * 1e9)))
    assert np.any(turning & (estimates.status != Status.TRACKING))
    slow = estimates.seen.v1 < scenario.leader.v_eps
    assert np.any(turning & slow)
    assert np.all(estimates.sd[slow, 3] >= math.pi / math.sqrt(3.0) - 1e-12)
    # The speed is through zero a moment before that is seen: then alpha1 is a guess, and said to be one.
    wrong = np.abs(errors_at(estimates, columns.truth.at(estimates.capture_ns))["alpha1"])
    tracking = turning & (estimates.status == Status.TRACKING)
    assert not np.any(tracking & ~slow & (wrong > 0.5 * math.pi))
    assert np.all(wrong[tracking] <= 5.0 * estimates.sd[tracking, 3])
