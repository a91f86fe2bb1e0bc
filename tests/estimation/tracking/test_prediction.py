from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.filters.belief import Model
from estimation.filters.estimators import make_estimator
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise, measure_body_from_mocap, measure_world
from estimation.tracking.estimate import Estimate, Joint, estimate_of
from estimation.tracking.prediction import (
    Reported,
    SentCommand,
    predicted,
    sight_of,
    still_needed,
    with_command,
)
from estimation.tracking.track import as_filter
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from estimation.tracking.turn_prediction import NO_TREND, TurnPrediction, TurnTrend
from formation.angles import FloatArray, wrap
from formation.kernel import entry, interpreted
from formation.line import Line, shape_of_line
from formation.pose import Pose, advance
from formation.records import Rows, borrowed, load, rows_of
from formation.ring import EMPTY, Ring, place
from formation.shape import Shape, shape_of
from tests.bits import same_bits

MS = 1_000_000
NOW_NS = 1_000 * MS


def estimate(v2: float = 0.1, u2: float = 0.4, alpha2: float = 1.2) -> Estimate:
    return Estimate(
        capture_ns=NOW_NS,
        measured_ns=NOW_NS,
        rho=0.3,
        alpha2=alpha2,
        rho_dot=0.0,
        alpha2_dot=0.0,
        v1=0.15,
        alpha1=-1.3,
        u1=0.6,
        v2=v2,
        u2=u2,
        joint=Joint(*np.eye(5)[np.triu_indices(5)].tolist()),
        nis=1.0,
        status=Status.TRACKING,
        jump=NO_JUMP,
    )


def reported(given: Estimate) -> Reported:
    return Reported(
        given.capture_ns,
        given.measured_ns,
        given.rho,
        given.alpha2,
        given.v1,
        given.alpha1,
        given.u1,
        float(given.covariance[4, 4]),
        given.v2,
        given.u2,
        float(given.covariance[3, 4]),
    )


@entry
def predicted_line(
    report: Reported, rows: Rows[SentCommand], sent: Ring, until_ns: int, lag: float, further: float
) -> Line:
    return predicted(sight_of(report), borrowed(rows), sent, until_ns, lag, further)


def predict_shape(
    given: Estimate, commands: list[SentCommand], until_ns: int, lag: float, further: float = 0.0
) -> Shape:
    """Prediction by the kernels, compiled and interpreted."""
    rows, sent = rows_of(SentCommand, 256), EMPTY
    for command in commands:
        sent = with_command(rows, sent, command)
    line = predicted_line(reported(given), rows, sent, until_ns, lag, further)
    plain = interpreted(predicted_line)(reported(given), rows, sent, until_ns, lag, further)
    same_bits(line, plain)
    return shape_of_line(line)


def integrated(
    given: Estimate, commands: list[SentCommand], until_ns: int, lag: float, slope: float = 0.0
) -> Shape:
    """The same future by an ODE: leader at constant v1, u1 on a ramp, follower through first-order lags."""
    x, y = given.rho * math.cos(given.alpha2), given.rho * math.sin(given.alpha2)
    state = np.array([x, y, given.alpha2 + math.pi - given.alpha1, 0.0, 0.0, 0.0, given.v2, given.u2])
    times_ns = [NOW_NS, *(min(max(c.from_ns, NOW_NS), until_ns) for c in commands), until_ns]
    for goal, (begin_ns, end_ns) in zip([None, *commands], pairwise(times_ns), strict=True):
        if end_ns == begin_ns:
            continue
        goal_v, goal_u = (float(state[6]), float(state[7])) if goal is None else (goal.v, goal.u)

        def rates(t: float, x: FloatArray, goal_v: float = goal_v, goal_u: float = goal_u) -> list[float]:
            leader = [given.v1 * math.cos(x[2]), given.v1 * math.sin(x[2]), given.u1 + slope * t]
            follower = [x[6] * math.cos(x[5]), x[6] * math.sin(x[5]), x[7]]
            return [*leader, *follower, (goal_v - x[6]) / lag, (goal_u - x[7]) / lag]

        span = ((begin_ns - NOW_NS) * 1e-9, (end_ns - NOW_NS) * 1e-9)
        state = solve_ivp(rates, span, state, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    return shape_of(Pose(*state[0:3]), Pose(*state[3:6]))


def assert_close(found: Shape, expected: Shape, tolerance: float) -> None:
    assert found.rho == pytest.approx(expected.rho, abs=tolerance)
    assert abs(wrap(found.alpha1 - expected.alpha1)) < tolerance
    assert abs(wrap(found.alpha2 - expected.alpha2)) < tolerance


commands_sent = st.lists(
    st.builds(
        SentCommand,
        st.integers(NOW_NS - 100 * MS, NOW_NS + 250 * MS),
        st.floats(-0.22, 0.22),
        st.floats(-2.8, 2.8),
    ),
    max_size=6,
).map(lambda commands: sorted(commands, key=lambda command: command.from_ns))


@given(commands_sent, st.integers(1, 200), st.floats(0.03, 0.3))
@settings(deadline=None, max_examples=30)
def test_prediction_is_the_solution_of_the_motion_ahead(
    commands: list[SentCommand], ahead_ms: int, lag: float
) -> None:
    found = predict_shape(estimate(), commands, NOW_NS + ahead_ms * MS, lag)
    # The arcs of mean motion leave about v u' dt^3: under 0.1 mm and well below the noise of any mocap.
    assert_close(found, integrated(estimate(), commands, NOW_NS + ahead_ms * MS, lag), 1e-3)


@given(st.floats(-1.1, 1.1), st.integers(1, 300))
@settings(deadline=None, max_examples=20)
def test_a_leader_turns_further_evenly_on_its_way(slope: float, ahead_ms: int) -> None:
    until_ns, ahead = NOW_NS + ahead_ms * MS, 1e-3 * ahead_ms
    found = predict_shape(estimate(), [], until_ns, 0.1, 0.5 * slope * ahead**2)
    expected = integrated(estimate(), [], until_ns, 0.1, slope)
    # Where it turns on its way makes v1 slope T^3 / 12: 0.4 mm at most, 0.3 m away.
    assert_close(found, expected, 1.5e-3)


def test_short_arcs_leave_nothing_of_that() -> None:
    commands = [SentCommand(NOW_NS - MS, 0.2, -2.0)] + [
        SentCommand(NOW_NS + k * MS, 0.2, -2.0) for k in range(150)
    ]
    found = predict_shape(estimate(), commands, NOW_NS + 150 * MS, 0.1)
    assert_close(found, integrated(estimate(), commands[:1], NOW_NS + 150 * MS, 0.1), 1e-7)


@pytest.mark.parametrize("apart_ms", [(8, 8, 12), (8, 12, 16), (5, 8, 5, 40)])
def test_commands_that_come_in_turns_after_different_times_act_for_their_own(
    apart_ms: tuple[int, ...],
) -> None:
    moments_ns = [NOW_NS + MS * sum((apart_ms * 6)[:k]) for k in range(12)]
    commands = [SentCommand(ns, 0.2 - 0.02 * (k % 5), 1.5 - 0.4 * (k % 7)) for k, ns in enumerate(moments_ns)]
    until_ns = moments_ns[-1] + 8 * MS
    found = predict_shape(estimate(), commands, until_ns, 0.1)
    assert_close(found, integrated(estimate(), commands, until_ns, 0.1), 2e-5)


def test_before_the_capture_nothing_is_predicted() -> None:
    for until_ns in (NOW_NS, NOW_NS - 500 * MS):
        assert_close(predict_shape(estimate(), [], until_ns, 0.1), Shape(0.3, -1.3, 1.2), 1e-15)


def test_without_commands_the_follower_keeps_its_motion() -> None:
    standing = estimate(v2=0.0, u2=0.0)
    moving = predict_shape(standing, [], NOW_NS + 200 * MS, 0.1)
    # Seen from a follower at rest, the leader drives on its own arc of 30 mm.
    leader = Pose(
        standing.rho * math.cos(standing.alpha2),
        standing.rho * math.sin(standing.alpha2),
        standing.alpha2 + math.pi - standing.alpha1,
    )
    radius, turned = 0.15 / 0.6, 0.6 * 0.2
    x = leader.x + radius * (math.sin(leader.theta + turned) - math.sin(leader.theta))
    y = leader.y - radius * (math.cos(leader.theta + turned) - math.cos(leader.theta))
    assert_close(moving, shape_of(Pose(x, y, leader.theta + turned), Pose(0.0, 0.0, 0.0)), 1e-12)


def test_without_lag_a_command_acts_at_once() -> None:
    stop = [SentCommand(NOW_NS, 0.0, 0.0)]
    assert_close(
        predict_shape(estimate(), stop, NOW_NS + 100 * MS, 0.0),
        predict_shape(estimate(v2=0.0, u2=0.0), [], NOW_NS + 100 * MS, 0.0),
        1e-14,
    )


def test_a_command_that_acts_later_changes_nothing_before() -> None:
    later = [SentCommand(NOW_NS + 100 * MS, -0.2, 2.0)]
    until_ns = NOW_NS + 100 * MS
    assert predict_shape(estimate(), later, until_ns, 0.1) == predict_shape(estimate(), [], until_ns, 0.1)


def test_an_older_command_that_still_acts_is_not_lost() -> None:
    before = [SentCommand(NOW_NS - 300 * MS, 0.0, 0.0)]
    found = predict_shape(estimate(), before, NOW_NS + 100 * MS, 0.1)
    assert_close(found, integrated(estimate(), before, NOW_NS + 100 * MS, 0.1), 1e-3)
    assert found != predict_shape(estimate(), [], NOW_NS + 100 * MS, 0.1)


def test_robots_that_are_predicted_onto_one_point_are_taken_as_they_were_seen() -> None:
    """The leader drives 0.1 m straight to where the follower stands."""
    facing = Estimate(
        **{name: getattr(estimate(0.0, 0.0), name) for name in Estimate._fields}
        | {"rho": 0.1, "alpha2": 0.0, "alpha1": 0.0, "v1": 0.1, "u1": 0.0}
    )
    assert predict_shape(facing, [], NOW_NS + 1000 * MS, 0.1) == Shape(0.1, 0.0, 0.0)


@pytest.mark.parametrize("alpha2", [0.0, 0.5 * math.pi])
def test_robots_that_come_to_share_one_coordinate_only_have_a_shape(alpha2: float) -> None:
    """Both stand; the leader is straight ahead of the follower, or abeam of it."""
    still = Estimate(
        **{name: getattr(estimate(0.0, 0.0, alpha2), name) for name in Estimate._fields}
        | {"v1": 0.0, "u1": 0.0}
    )
    turning = [SentCommand(NOW_NS, 0.0, 1.0)]
    found = predict_shape(still, turning, NOW_NS + 100 * MS, 0.0)
    assert_close(found, Shape(0.3, -1.3, alpha2 - 0.1), 1e-12)


@given(commands_sent, st.integers(NOW_NS - 100 * MS, NOW_NS + 250 * MS))
def test_commands_that_no_prediction_needs_change_none(commands: list[SentCommand], begin_ns: int) -> None:
    rows, sent = rows_of(SentCommand, 64), EMPTY
    for command in commands:
        sent = with_command(rows, sent, command)
    left = still_needed(rows, sent, begin_ns)
    late = sight_of(reported(estimate())._replace(capture_ns=begin_ns))
    for ring in (sent, left):
        same_bits(
            predicted(late, rows, ring, begin_ns + 300 * MS, 0.1, 0.0),
            predicted(late, rows, sent, begin_ns + 300 * MS, 0.1, 0.0),
        )
    kept = [load(SentCommand, rows, place(left, rows, k)).from_ns for k in range(left.length)]
    assert all(from_ns > begin_ns for from_ns in kept[1:])


def test_in_full_rows_the_oldest_command_gives_way_and_the_newest_moment_is_there_once() -> None:
    rows, sent = rows_of(SentCommand, 4), EMPTY
    for k in (0, 1, 2, 3, 4, 5, 5):
        sent = with_command(rows, sent, SentCommand(k, 0.1 * len(str(sent)), 0.0))
    kept = [load(SentCommand, rows, place(sent, rows, k)).from_ns for k in range(sent.length)]
    assert kept == [2, 3, 4, 5]


STEP_NS, AHEAD = 8_333_333, 16
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
BY_RULE = ProcessNoise.by_rule(LIMITS, 0.5)


def swinging_pair(count: int) -> list[tuple[Pose, Pose]]:
    """A leader that swings between -0.3 and 0.7 rad/s in 4 s, and a follower on an arc."""
    leader, follower, pair = Pose(0.0, 0.0, 0.3), Pose(0.1, -0.2, 0.2), []
    for k in range(count):
        pair.append((leader, follower))
        u1 = 0.2 + 0.5 * math.sin(0.5 * math.pi * (k + 0.5) * STEP_NS * 1e-9)
        leader = advance(leader, 0.08, u1, STEP_NS * 1e-9)
        follower = advance(follower, 0.1, 0.2, STEP_NS * 1e-9)
    return pair


def alpha1_errors(kind: str, front_end: FrontEnd, sigma: float) -> tuple[float, float]:
    """RMS errors of alpha1 predicted over 0.13 s, with u1 held and turned further; nothing is noisy."""
    measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
    own, noise = FollowerMotion(0.1, 0.2, 2e-3, 1e-2), PoseNoise(sigma, 0.0035)
    of = as_filter(make_estimator(kind, Model(front_end, LIMITS, BY_RULE)))
    turn_prediction = TurnPrediction.of(LIMITS.k_u, BY_RULE.q_u)
    pair, ahead, trend = swinging_pair(840), AHEAD * STEP_NS * 1e-9, NO_TREND
    belief, errors = None, []
    for k, (leader, follower) in enumerate(pair[:-AHEAD]):
        seen = measure(k * STEP_NS, (leader.x, leader.y), follower, noise, own)
        belief = (
            of.start(seen) if belief is None else of.update(of.predict(belief, STEP_NS * 1e-9, own), seen)
        )
        found = estimate_of(belief, seen, Status.TRACKING, 1.0, seen.capture_ns, NO_JUMP)
        trend = heard(turn_prediction, trend, found, ahead)
        if k < 360:
            continue
        until_ns, true = (k + AHEAD) * STEP_NS, shape_of(*pair[k + AHEAD]).alpha1
        turns = (0.0, turn_prediction.further(trend, ahead))
        errors.append([predict_shape(found, [], until_ns, 0.0, turn).alpha1 - true for turn in turns])
    held, carried = np.sqrt(np.mean(wrap(np.array(errors)) ** 2, axis=0))
    return float(held), float(carried)


def heard(turn_prediction: TurnPrediction, trend: TurnTrend, found: Estimate, ahead: float) -> TurnTrend:
    return turn_prediction.heard(trend, found.capture_ns, found.u1, float(found.covariance[4, 4]), ahead)


@pytest.mark.parametrize(
    ("kind", "front_end", "share"),
    [
        ("ekf", FrontEnd.WORLD, 0.5),
        ("ukf", FrontEnd.WORLD, 0.5),
        ("imm", FrontEnd.WORLD, 0.7),
        ("ekf", FrontEnd.BODY, 0.6),
        ("shape-ekf", FrontEnd.BODY, 0.6),
    ],
)
def test_behind_a_swinging_leader_less_is_left_than_with_its_turn_rate_held(
    kind: str, front_end: FrontEnd, share: float
) -> None:
    held, carried = alpha1_errors(kind, front_end, 3e-4)
    assert carried < share * held


def test_an_estimator_that_knows_nothing_of_the_turn_rate_is_predicted_as_it_is() -> None:
    held, carried = alpha1_errors("difference", FrontEnd.WORLD, 3e-4)
    assert carried == held


def test_robots_predicted_onto_one_point_keep_the_shape_that_was_seen() -> None:
    """In a thirty-second of a second a follower at 8 m/s reaches a leader that stands 0.25 m ahead."""
    until_ns = NOW_NS + 31_250_000
    standing = estimate(v2=8.0, u2=0.0, alpha2=0.0)._replace(rho=0.25, v1=0.0, u1=0.0, alpha1=-2.0)
    assert predict_shape(standing, [], until_ns, 0.0) == Shape(0.25, -2.0, 0.0)
    # One coordinate in common is no meeting.
    assert_close(predict_shape(standing._replace(v2=4.0), [], until_ns, 0.0), Shape(0.125, -2.0, 0.0), 1e-12)
    beside = standing._replace(alpha2=1.0, v2=32.0 * 0.25 * math.cos(1.0))
    expected = Shape(0.25 * math.sin(1.0), -2.0 - 1.0 + 0.5 * math.pi, 0.5 * math.pi)
    assert_close(predict_shape(beside, [], until_ns, 0.0), expected, 1e-12)
