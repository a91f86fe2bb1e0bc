"""What every estimator must do with measurements that come as they come, in both front ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass

import numpy as np
import pytest
from scipy.stats import chi2

from estimation.filters.belief import Model
from estimation.filters.estimators import ESTIMATORS, make_estimator, settling
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body_from_mocap,
    measure_world,
)
from estimation.tracking.estimate import Estimate, estimate_at
from estimation.tracking.follower_check import Cause
from estimation.tracking.track import Track, Tracker
from estimation.tracking.track_point import SAME_NS, JumpUncertainty, TrackPoint, Verdict, with_motion
from estimation.tracking.track_settings import TrackSettings, gate_of
from estimation.tracking.tracker import Status, add, capture_at, place_of, point_at, reprocessed, status_of
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.records import rows_of, store
from formation.ring import EMPTY
from formation.shape import shape_of

RATE = 120.0
FRAME_NS = round(1e9 / RATE)
EPOCH_NS = 1_000_000_000
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
NOISE = PoseNoise(position=3e-4, heading=math.radians(0.2))
COARSE = PoseNoise(position=3e-3, heading=math.radians(1.0))
DRIVING = Motion(0.08, 0.5)
# Filterpy's filters are the peers of the compiled ones and give the same; other tests hold them to that.
CASES = [(kind, front_end) for kind in ESTIMATORS if "filterpy" not in kind for front_end in FrontEnd]
KALMAN = [(kind, front_end) for kind, front_end in CASES if kind != "difference"]


@dataclass(frozen=True)
class Drive:
    """What really happened and what was measured of it, frame by frame."""

    leader: list[Pose]
    follower: list[Pose]
    motion: Motion
    measurements: list[Measurement]


def drive(
    front_end: FrontEnd,
    seed: int,
    count: int,
    *,
    driven: Motion = DRIVING,
    bearing: float = 1.2,
    heading: float = 0.4,
    noise: PoseNoise = NOISE,
) -> Drive:
    """Leader at a distance of 0.4 m under a bearing, both robots on arcs, mocap and odometry noisy."""
    generator = np.random.default_rng(seed)
    own = Motion(0.07, -0.3)
    follower = Pose(-0.5, 0.3, 0.9)
    line = follower.theta + bearing
    leader = Pose(follower.x + 0.4 * math.cos(line), follower.y + 0.4 * math.sin(line), heading)
    result = Drive([], [], driven, [])
    for k in range(count):
        shake = generator.standard_normal(7) * ([noise.position] * 4 + [noise.heading, 2e-3, 1e-2])
        seen = (leader.x + shake[0], leader.y + shake[1])
        pose = Pose(follower.x + shake[2], follower.y + shake[3], wrap(follower.theta + float(shake[4])))
        motion = FollowerMotion(own.v + shake[5], own.u + shake[6], 5e-3, 3e-2)
        measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
        result.measurements.append(measure(EPOCH_NS + k * FRAME_NS, seen, pose, noise, motion))
        result.leader.append(leader)
        result.follower.append(follower)
        leader = advance(leader, driven.v, driven.u, FRAME_NS * 1e-9)
        follower = advance(follower, own.v, own.u, FRAME_NS * 1e-9)
    return result


def tracker(kind: str, front_end: FrontEnd, settings: TrackSettings | None = None) -> Tracker:
    model = Model(front_end, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
    # Differences are held to what is asked of filters, the peer in shape space to what it needs.
    usual = TrackSettings(settled_heading=min(settling(name).settled_heading for name in ("ekf", kind)))
    return Tracker(make_estimator(kind, model), settings or usual)


def folded(
    of: Tracker, measurements: Sequence[Measurement], track: Track = ()
) -> tuple[Track, list[Verdict]]:
    verdicts = []
    for measurement in measurements:
        track, verdict = of.add(track, measurement)
        verdicts.append(verdict)
    return track, verdicts


def status_now(of: Tracker, track: Track) -> Status:
    return of.status(track, track[-1].measurement.capture_ns)


def newest(of: Tracker, track: Track) -> Estimate:
    return estimate_at(track[-1], status_now(of, track))


def same(left: object, right: object) -> bool:
    """Equal to the last bit, all that is remembered included."""
    if isinstance(left, np.ndarray) and isinstance(right, np.ndarray):
        return np.array_equal(left, right)
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(map(same, left, right))
    if is_dataclass(left) and type(left) is type(right):
        return all(same(getattr(left, each.name), getattr(right, each.name)) for each in fields(left))
    return left == right


def moved(measurement: Measurement, dx: float, dy: float) -> Measurement:
    """The same moment with the leader seen elsewhere, by an offset along the axes of the measurement."""
    return measurement._replace(x=measurement.x + dx, y=measurement.y + dy)


@pytest.mark.parametrize(("kind", "front_end"), CASES)
@pytest.mark.parametrize(
    ("bearing", "heading"), [(-2.8, -2.0), (-2.8, 3.1), (-0.7, 0.1), (1.5, -2.0), (1.5, 3.1)]
)
def test_from_no_knowledge_it_settles_wherever_the_leader_is_and_goes(
    kind: str, front_end: FrontEnd, bearing: float, heading: float
) -> None:
    run = drive(front_end, hash_of(bearing, heading), 180, bearing=bearing, heading=heading)
    of = tracker(kind, front_end)
    track: Track = ()
    settled_at = None
    for k, measurement in enumerate(run.measurements):
        track, _ = of.add(track, measurement)
        if settled_at is None and status_now(of, track) is Status.TRACKING:
            settled_at = k / RATE
    assert settled_at is not None
    assert settled_at <= 1.1
    found, shape = newest(of, track), shape_of(run.leader[-1], run.follower[-1])
    assert found.status is Status.TRACKING
    sd = np.sqrt(np.diag(found.covariance))
    assert abs(found.v1 - 0.08) < 4.0 * sd[2] < 0.1
    assert abs(wrap(found.alpha1 - shape.alpha1)) < 4.0 * sd[3] < 1.2
    assert found.rho == pytest.approx(shape.rho, abs=5e-3)


def hash_of(*values: float) -> int:
    return round(1000.0 * sum(abs(value) * (k + 1) for k, value in enumerate(values)))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_when_it_says_tracking_the_direction_is_known(kind: str, front_end: FrontEnd) -> None:
    errors = []
    for seed in range(6):
        run = drive(front_end, seed, 160, heading=seed - 3.0, bearing=1.1 * seed - 3.0)
        of = tracker(kind, front_end)
        track: Track = ()
        for k, measurement in enumerate(run.measurements):
            track, _ = of.add(track, measurement)
            if status_now(of, track) is Status.TRACKING:
                alpha1 = shape_of(run.leader[k], run.follower[k]).alpha1
                errors.append(wrap(newest(of, track).alpha1 - alpha1))
    # The settled track claims 0.35 rad or better at one sigma.
    assert np.max(np.abs(errors)) < 0.75


@pytest.mark.parametrize(("kind", "front_end"), CASES)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_order_of_arrival_within_the_window_does_not_matter_to_the_last_bit(
    kind: str, front_end: FrontEnd, seed: int
) -> None:
    run = drive(front_end, seed, 90)
    generator = np.random.default_rng(100 + seed)
    kept = [k for k in range(90) if k == 0 or generator.random() > 0.1]
    delays = generator.uniform(0.0, 0.15, len(kept))
    delays[0] = 0.0
    arrival = np.argsort([k / RATE + delay for k, delay in zip(kept, delays, strict=True)], kind="stable")
    of = tracker(kind, front_end)
    in_order, _ = folded(of, [run.measurements[k] for k in kept])
    shuffled, verdicts = folded(of, [run.measurements[kept[place]] for place in arrival])
    assert Verdict.LATE not in verdicts
    assert [p.measurement.capture_ns for p in in_order] == [p.measurement.capture_ns for p in shuffled]
    for left, right in zip(in_order, shuffled, strict=True):
        assert same(left.belief, right.belief)
        assert (left.verdict, left.used_ns, left.settled) == (right.verdict, right.used_ns, right.settled)


def at_nearly_the_same_time(measurement: Measurement, later_ns: int) -> Measurement:
    return measurement._replace(capture_ns=measurement.capture_ns + later_ns)


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_duplicates_and_too_late_ones_change_nothing_and_are_told_apart(
    kind: str, front_end: FrontEnd
) -> None:
    run = drive(front_end, 5, 60)
    of = tracker(kind, front_end)
    track, _ = folded(of, run.measurements[:20] + run.measurements[21:])
    for late, verdict in (
        (run.measurements[-1], Verdict.DUPLICATE),
        (run.measurements[-7], Verdict.DUPLICATE),
        (at_nearly_the_same_time(run.measurements[-1], SAME_NS - 1), Verdict.DUPLICATE),
        (at_nearly_the_same_time(run.measurements[-7], 1 - SAME_NS), Verdict.DUPLICATE),
        (run.measurements[20], Verdict.LATE),
        (run.measurements[0], Verdict.LATE),
    ):
        assert of.add(track, late) == (track, verdict)


def test_nothing_can_be_folded_in_before_the_beginning() -> None:
    run = drive(FrontEnd.WORLD, 5, 3)
    of = tracker("ekf", FrontEnd.WORLD)
    track, _ = folded(of, run.measurements[1:])
    assert of.add(track, run.measurements[0])[1] is Verdict.LATE


def test_the_ring_stays_short() -> None:
    track, _ = folded(tracker("ekf", FrontEnd.WORLD), drive(FrontEnd.WORLD, 1, 200).measurements)
    assert len(track) <= 0.2 * RATE + 3


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_single_outliers_are_gated_and_forgotten(kind: str, front_end: FrontEnd) -> None:
    run = drive(front_end, 6, 300)
    of = tracker(kind, front_end)
    wild = list(run.measurements)
    generator = np.random.default_rng(7)
    struck = range(150, 300, 10)
    for k in struck:
        angle = generator.uniform(-math.pi, math.pi)
        wild[k] = moved(wild[k], 0.15 * math.cos(angle), 0.15 * math.sin(angle))
    track: Track = ()
    for k, measurement in enumerate(wild):
        track, verdict = of.add(track, measurement)
        assert (verdict is Verdict.GATED) == (k in struck), k
        if k in struck:
            assert status_now(of, track) is Status.REJECTING
    assert newest(of, track).v1 == pytest.approx(0.08, abs=0.02)


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_a_leader_that_jumped_a_little_is_taken_up_again_after_some_frames_that_agree(
    kind: str, front_end: FrontEnd
) -> None:
    run = drive(front_end, 8, 420)
    jumped = [moved(m, 0.05, -0.03) if k >= 150 else m for k, m in enumerate(run.measurements)]
    of = tracker(kind, front_end, TrackSettings(reacquire_frames=5))
    track, verdicts = folded(of, jumped)
    # In the body frame the offset of a real body would turn with the follower: it drifts, but does not jump.
    assert verdicts[150:155] == [Verdict.GATED] * 4 + [Verdict.RESTARTED]
    assert verdicts[155:].count(Verdict.GATED) <= 5
    assert status_now(of, track) is Status.TRACKING


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_one_that_jumped_far_is_given_time_to_come_back_until_it_is_lost(
    kind: str, front_end: FrontEnd
) -> None:
    run = drive(front_end, 8, 420)
    jumped = [moved(m, 0.5, -0.3) if k >= 150 else m for k, m in enumerate(run.measurements)]
    of = tracker(kind, front_end)
    gone, _ = folded(of, jumped[:150])
    for since, back in ((150, 200), (200, 260)):
        gone, verdicts = folded(of, jumped[since:back], gone)
        assert set(verdicts) == {Verdict.GATED}
        track, verdicts = folded(of, run.measurements[back : back + 60], gone)
        assert verdicts.count(Verdict.GATED) <= 5
        assert status_now(of, track) is Status.TRACKING
    track, verdicts = folded(of, jumped[260:], gone)
    assert verdicts[:11] == [Verdict.GATED] * 10 + [Verdict.RESTARTED]
    assert status_now(of, track) is Status.TRACKING


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_after_a_jump_it_is_not_settled_until_it_knows_the_direction_again(
    kind: str, front_end: FrontEnd
) -> None:
    run = drive(front_end, 8, 186, noise=COARSE)
    jumped = [moved(m, 0.05, -0.03) if k >= 180 else m for k, m in enumerate(run.measurements)]
    of = tracker(kind, front_end)
    track, verdicts = folded(of, jumped)
    assert Verdict.RESTARTED in verdicts[180:]
    assert status_now(of, track) is Status.INITIALISING


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_random_garbage_is_not_swallowed(kind: str, front_end: FrontEnd) -> None:
    run = drive(front_end, 9, 400)
    generator = np.random.default_rng(10)
    anywhere = generator.uniform(-2.0, 2.0, (60, 2)).tolist()
    garbage = [
        m._replace(x=anywhere[k - 200][0], y=anywhere[k - 200][1]) if 200 <= k < 260 else m
        for k, m in enumerate(run.measurements)
    ]
    of = tracker(kind, front_end)
    track, verdicts = folded(of, garbage)
    assert verdicts[200:260].count(Verdict.GATED) >= 57
    assert status_now(of, track) is Status.TRACKING
    assert newest(of, track).v1 == pytest.approx(0.08, abs=0.02)


@pytest.mark.parametrize(("kind", "front_end"), CASES)
def test_through_a_gap_it_coasts_then_is_lost_then_starts_anew(kind: str, front_end: FrontEnd) -> None:
    run = drive(front_end, 11, 480)
    of = tracker(kind, front_end)
    track, _ = folded(of, run.measurements[:180])
    last_ns = track[-1].measurement.capture_ns
    assert of.status(track, last_ns + 250_000_000) is Status.TRACKING
    assert of.status(track, last_ns + 251_000_000) is Status.COASTING
    assert of.status(track, last_ns + 1_000_000_000) is Status.COASTING
    assert of.status(track, last_ns + 1_001_000_000) is Status.LOST
    # Half a second later it goes on where it was; after more than a second it begins from the beginning.
    soon, verdict = of.add(track, run.measurements[240])
    assert verdict is Verdict.USED
    assert status_now(of, soon) is Status.TRACKING
    late, verdict = of.add(track, run.measurements[302])
    assert verdict is Verdict.RESTARTED
    assert status_now(of, late) is Status.INITIALISING
    late, _ = folded(of, run.measurements[303:], late)
    assert status_now(of, late) is Status.TRACKING


@pytest.mark.parametrize(("kind", "front_end"), KALMAN)
def test_coasting_follows_the_leader_round_its_curve(kind: str, front_end: FrontEnd) -> None:
    run = drive(front_end, 12, 300)
    of = tracker(kind, front_end)
    track, _ = folded(of, run.measurements[:240])
    track, _ = of.add(track, run.measurements[299])
    found, shape = newest(of, track), shape_of(run.leader[299], run.follower[299])
    assert abs(wrap(found.alpha1 - shape.alpha1)) < 0.2


@pytest.mark.parametrize(("kind", "front_end"), CASES)
@pytest.mark.parametrize(("seed", "noise"), [(0, NOISE), (1, COARSE)])
def test_a_leader_that_stands_is_never_tracked(
    kind: str, front_end: FrontEnd, seed: int, noise: PoseNoise
) -> None:
    run = drive(front_end, seed, 360, driven=Motion(0.0, 0.0), noise=noise)
    of = tracker(kind, front_end)
    track: Track = ()
    for measurement in run.measurements:
        track, _ = of.add(track, measurement)
        assert status_now(of, track) is Status.INITIALISING or track[-1].verdict == Verdict.GATED


def test_an_empty_track_is_initialising() -> None:
    assert tracker("ekf", FrontEnd.WORLD).status((), 0) is Status.INITIALISING


@pytest.mark.parametrize("v", [0.1, -0.1])
@pytest.mark.parametrize("gap", [1, 20])
@pytest.mark.parametrize("angle", [0.3, 1.8, -2.2, -0.8])
def test_a_follower_may_be_off_by_what_its_noise_and_motion_leave_in_any_direction_and_gear(
    v: float, gap: int, angle: float
) -> None:
    own, leader = Motion(v, 0.4), Pose(0.4, 0.5, 0.0)
    measured = FollowerMotion(own.v, own.u, 5e-3, 3e-2)
    of = tracker("ekf", FrontEnd.WORLD)
    follower = last = Pose(-0.5, 0.3, 0.9)
    track: Track = ()
    for k in range(120):
        seen = measure_world(EPOCH_NS + k * FRAME_NS, (leader.x, leader.y), follower, NOISE, measured)
        track, verdict = of.add(track, seen)
        assert verdict in (Verdict.USED, Verdict.RESTARTED)
        leader, last = advance(leader, 0.08, 0.0, FRAME_NS * 1e-9), follower
        follower = advance(follower, own.v, own.u, FRAME_NS * 1e-9)
    # By hand: a tenth of each motion for slip, and both standard deviations grow with time.
    dt = gap * FRAME_NS * 1e-9
    here = advance(last, own.v, own.u, dt)
    leader = advance(Pose(0.4, 0.5, 0.0), 0.08, 0.0, (119 + gap) * FRAME_NS * 1e-9)
    sd_heading = (3e-2 + 0.1 * 0.4) * dt
    sd_position = (5e-3 + 0.1 * 0.1 + 0.1 * sd_heading) * dt
    gate = -2.0 * math.log(1e-4)
    reach = math.sqrt(gate * (2.0 * NOISE.position**2 + sd_position**2))
    turn = math.sqrt(gate * (2.0 * NOISE.heading**2 + sd_heading**2))
    for share, expected in ((0.99, Cause.NONE), (1.01, Cause.FOLLOWER)):
        aside = here._replace(
            x=here.x + share * reach * math.cos(angle), y=here.y + share * reach * math.sin(angle)
        )
        for pose in (aside, here._replace(theta=here.theta + math.copysign(share * turn, angle))):
            at_ns = EPOCH_NS + (119 + gap) * FRAME_NS
            after, verdict = of.add(track, measure_world(at_ns, (leader.x, leader.y), pose, NOISE, measured))
            assert after[-1].cause == expected
            assert verdict is (Verdict.USED if expected is Cause.NONE else Verdict.GATED)


@pytest.mark.parametrize("share", [0.5, 0.99, 0.9999])
def test_the_gate_lets_its_share_of_good_measurements_pass(share: float) -> None:
    assert gate_of(share) == pytest.approx(chi2.ppf(share, 2), rel=1e-9)


@pytest.mark.parametrize(
    ("silent_ns", "verdict", "settled", "status"),
    [
        (0, Verdict.USED, True, Status.TRACKING),
        (0, Verdict.USED, False, Status.INITIALISING),
        (0, Verdict.RESTARTED, True, Status.TRACKING),
        (0, Verdict.GATED, True, Status.REJECTING),
        (250_000_000, Verdict.USED, True, Status.TRACKING),
        (250_000_001, Verdict.USED, True, Status.COASTING),
        (250_000_001, Verdict.USED, False, Status.COASTING),
        (250_000_001, Verdict.GATED, True, Status.REJECTING),
        (1_000_000_000, Verdict.USED, True, Status.COASTING),
        (1_000_000_001, Verdict.USED, True, Status.LOST),
        (1_000_000_001, Verdict.GATED, True, Status.LOST),
    ],
)
def test_what_a_status_says_first_is_what_must_be_known_first(
    silent_ns: int, verdict: Verdict, settled: bool, status: Status
) -> None:
    of = tracker("ekf", FrontEnd.WORLD)
    begun = of.begin(drive(FrontEnd.WORLD, 1, 1).measurements[0])
    point = begun._replace(verdict=verdict.value, settled=settled)
    assert status_of(point, EPOCH_NS + silent_ns, TrackSettings()) == status


def test_a_jump_stays_uncertain_for_two_seconds() -> None:
    run, of = drive(FrontEnd.WORLD, 2, 2), tracker("ekf", FrontEnd.WORLD)
    due_ns = EPOCH_NS + FRAME_NS
    for since_ns, lasts in ((due_ns - 2_000_000_000, True), (due_ns - 2_000_000_001, False)):
        jump = JumpUncertainty(0.1, 0.2, since_ns)
        point = of.begin(run.measurements[0])._replace(jump=jump)
        assert of.follow(point, run.measurements[1]).jump == (jump if lasts else JumpUncertainty(0.0, 0.0, 0))


def test_the_ring_holds_its_window_and_the_point_before() -> None:
    of, rows, ring = tracker("ekf", FrontEnd.WORLD), rows_of(TrackPoint, 64), EMPTY
    captures: list[int] = []
    # Two frames are missing, so that points lie at the edge of the window and just beyond it.
    for k, measurement in enumerate(drive(FrontEnd.WORLD, 1, 90).measurements):
        if k in (30, 31):
            continue
        at_ns = EPOCH_NS + k * 10_000_000
        captures.append(at_ns)
        ring, verdict, _ = add(rows, ring, measurement._replace(capture_ns=at_ns), of.settings, of.estimator)
        assert verdict in (Verdict.USED, Verdict.RESTARTED)
        within = [each for each in captures if each >= at_ns - 200_000_000]
        expected = captures[-min(len(within) + 1, len(captures)) :]
        assert [capture_at(rows, ring, j) for j in range(ring.length)] == expected
        for moment_ns in (expected[0] - 1, expected[0], at_ns - 15_000_000, at_ns, at_ns + 1):
            assert place_of(rows, ring, moment_ns) == sum(each < moment_ns for each in expected)


def test_what_has_changed_in_place_is_folded_anew_from_there() -> None:
    run, of = drive(FrontEnd.BODY, 3, 12), tracker("ekf", FrontEnd.BODY)
    other = FollowerMotion(0.09, -0.2, 4e-3, 2e-2)
    changed = [
        each._replace(motion=other) if k in (7, 9) else each for k, each in enumerate(run.measurements)
    ]
    rows, ring = rows_of(TrackPoint, 16), EMPTY
    for measurement in run.measurements:
        ring = add(rows, ring, measurement, of.settings, of.estimator).ring
    for k in (7, 9):
        store(rows, k, with_motion(point_at(rows, ring, k), other))
    assert reprocessed(rows, ring, 7, of.settings, of.estimator) == 5
    expected, _ = folded(of, changed)
    assert tuple(point_at(rows, ring, k) for k in range(12))[1:] == expected[1:]
