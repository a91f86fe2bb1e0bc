"""The noise of a motion capture as its frames tell it: right whatever the spacing, and never the motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation.consistency.noise_estimate import (
    NOISE_AS_TOLD,
    REFUTED,
    Moment,
    NoiseEstimate,
    NoiseLearning,
    is_another,
    kept_noise,
    noise_with_frame,
    scaled_noise,
)
from estimation.consistency.noise_level import LEAST_SCALE, MOST_SCALE
from estimation.models.measurement import PairSeen, PoseNoise
from formation.pose import Pose, advance

TOLD = PoseNoise(3e-4, 3.5e-3)
LEARNING = NoiseLearning(True, TOLD, 0.04)
NOW_NS = 1_700_000_000_000_000_000
SEEDS = range(3)

Normals = Callable[[np.random.Generator], NDArray[np.float64]]
Speed = Callable[[float], float]


def gaussian(random: np.random.Generator) -> NDArray[np.float64]:
    return random.standard_normal(5)


def heavy_tailed(random: np.random.Generator) -> NDArray[np.float64]:
    """Student's t with three degrees of freedom, of unit variance."""
    return random.standard_t(3, 5) / math.sqrt(3.0)


def with_outliers(random: np.random.Generator) -> NDArray[np.float64]:
    return random.standard_normal(5) * np.where(random.random(5) < 0.02, 20.0, 1.0)


def frames(
    seed: int,
    scale: float | Speed,
    *,
    seconds: float = 6.0,
    rate: float = 120.0,
    kept: float = 1.0,
    jitter: float = 0.0,
    normals: Normals = gaussian,
    speed: Speed = lambda t: 0.1,
    told: PoseNoise = TOLD,
) -> Iterator[tuple[float, Moment]]:
    """Two robots in curves; the leader's speed at each time is given, and the scale of the noise.

    ``kept``: share of frames that arrive. ``jitter``: of their spacing, in periods.
    """
    random = np.random.default_rng([seed, 9])
    leader, follower, last = Pose(0.0, 0.0, 0.3), Pose(0.1, -0.3, 0.3), 0.0
    for k in range(round(seconds * rate)):
        t = (k + jitter * random.uniform(-0.5, 0.5)) / rate
        leader = advance(leader, speed(t), 0.5 * math.sin(1.6 * t), t - last)
        follower = advance(follower, 0.1, 0.6 * math.sin(1.1 * t), t - last)
        last = t
        n = (scale(t) if callable(scale) else scale) * normals(random)
        a, b = (told.position * n[:4]).reshape(2, 2).tolist()
        pose = Pose(follower.x + b[0], follower.y + b[1], follower.theta + told.heading * float(n[4]))
        if random.random() < kept:
            yield t, Moment(NOW_NS + round(t * 1e9), PairSeen(leader.x + a[0], leader.y + a[1], pose))


def learned(
    seen: Iterator[tuple[float, Moment]], learning: NoiseLearning = LEARNING
) -> list[tuple[float, NoiseEstimate]]:
    estimate, found = NOISE_AS_TOLD, []
    for t, moment in seen:
        estimate = noise_with_frame(estimate, moment, False, learning)
        found.append((t, estimate))
    return found


def scales(found: list[tuple[float, NoiseEstimate]], since: float = 3.0) -> NDArray[np.float64]:
    return np.array([estimate.scale for t, estimate in found if t >= since])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("true", "most_off"), [(1 / 3, 1.25), (3.0, 1.15), (10.0, 1.25), (25.0, 1.3)])
def test_noise_other_than_told_is_found(true: float, most_off: float, seed: int) -> None:
    found = scales(learned(frames(seed, true)))
    assert np.all(found[:, 0] / true < most_off)
    assert np.all(found[:, 0] / true > 1.0 / most_off)
    # Of headings there is one in a frame, where there are four coordinates.
    assert np.all(np.abs(np.log(found[-1, 1] / true)) < math.log(1.35))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("kept", "jitter"), [(1.0, 0.0), (0.7, 0.0), (0.9, 0.9)])
def test_told_rightly_it_is_as_told_however_frames_are_spaced(kept: float, jitter: float, seed: int) -> None:
    found = learned(frames(seed, 1.0, kept=kept, jitter=jitter))
    assert np.all(np.abs(scales(found, since=0.0)[:, 0] - 1.0) < 0.25)
    assert np.all(np.abs(scales(found, since=1.0)[:, 0] - 1.0) < 0.1)
    assert np.mean(scales(found, since=0.0)[:, 0] == 1.0) > 0.7


@pytest.mark.parametrize("seed", SEEDS)
def test_half_a_second_opens_a_gate_of_four_deviations_to_ten_times_the_noise(seed: int) -> None:
    found = learned(frames(seed, 10.0, seconds=0.6))
    assert all(estimate.scale.position > 5.0 for t, estimate in found if t >= 0.5)


@pytest.mark.parametrize("seed", SEEDS)
def test_slow_sensors_and_coarse_ones_are_learned_too(seed: int) -> None:
    told = PoseNoise(0.025, 0.02)
    learning = NoiseLearning(True, told, 0.04)
    found = scales(learned(frames(seed, 3.0, seconds=60.0, rate=10.0, told=told), learning), since=30.0)
    assert np.all(np.abs(np.log(found[:, 0] / 3.0)) < math.log(1.2))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("normals", [heavy_tailed, with_outliers])
def test_heavy_tails_and_outliers_do_not_carry_it_away(normals: Normals, seed: int) -> None:
    found = scales(learned(frames(seed, 1.0, normals=normals)))
    assert np.all((found[:, 0] > 0.7) & (found[:, 0] < 1.2))


def stop_and_go(t: float) -> float:
    """At rest and at 0.2 m/s by turns, at once each time."""
    return 0.2 if t % 2.0 < 1.0 else 0.0


def in_steps(t: float) -> float:
    return 0.08 + 0.08 * (int(t / 0.7) % 3)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("speed", [stop_and_go, in_steps])
def test_the_leaders_manoeuvres_are_not_noise(speed: Speed, seed: int) -> None:
    found = scales(learned(frames(seed, 1.0, speed=speed)), since=0.0)
    assert np.all(np.abs(found[:, 0] - 1.0) < 0.15)


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_that_grows_is_found_within_a_second_and_so_is_its_end(seed: int) -> None:
    found = learned(frames(seed, lambda t: 5.0 if 4.0 <= t < 7.0 else 1.0, seconds=10.0))
    for since, to, true in ((2.0, 4.0, 1.0), (5.0, 7.0, 5.0), (8.0, 10.0, 1.0)):
        there = np.array([estimate.scale.position for t, estimate in found if since <= t < to])
        assert np.all(np.abs(np.log(there / true)) < math.log(1.6))


def test_who_stands_is_not_asked() -> None:
    moving = learned(frames(1, 1.0, seconds=3.0))[-1][1]
    estimate, pose = moving, Pose(0.0, 0.0, 0.0)
    random = np.random.default_rng(1)
    for k in range(600):
        x, y = (0.05 * TOLD.position * random.standard_normal(2)).tolist()
        moment = Moment(NOW_NS + 10_000_000_000 + 8_333_333 * k, PairSeen(1.0 + x, y, pose._replace(x=x)))
        estimate = noise_with_frame(estimate, moment, False, LEARNING)
    assert estimate.scale == moving.scale
    assert estimate.by_frame == moving.by_frame


def test_poses_that_repeat_tell_nothing() -> None:
    """Every pose is shown twice; the difference of two that are one would be none."""
    random = np.random.default_rng(1)
    estimate, seen = NOISE_AS_TOLD, PairSeen(0.0, 0.0, Pose(0.0, 0.0, 0.0))
    for k in range(1200):
        if k % 2 == 0:
            t = k / 120.0
            n = (TOLD.position * random.standard_normal(4)).tolist()
            turned = TOLD.heading * float(random.standard_normal())
            pose = Pose(0.1 * t + n[2], 0.5 + n[3], turned)
            seen = PairSeen(0.1 * t + n[0], n[1], pose)
        moment = Moment(NOW_NS + round(k / 120.0 * 1e9), seen)
        estimate = noise_with_frame(estimate, moment, False, LEARNING)
    assert estimate.by_frame == NOISE_AS_TOLD.by_frame
    assert estimate.scale.position == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("seed", SEEDS)
def test_shaking_that_frames_share_keeps_the_noise_from_seeming_small(seed: int) -> None:
    """A body that shakes by as much as is told, seven times a second: neighbouring frames differ little."""
    shaken = (
        (t, moment._replace(seen=_shaken(moment.seen, 1.4 * TOLD.position * math.sin(44.0 * t))))
        for t, moment in frames(seed, 0.2, seconds=12.0)
    )
    found = scales(learned(shaken), since=8.0)
    assert np.all(found[:, 0] > 0.5)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("hertz", [3.6, 4.7, 5.9])
def test_bodies_that_rock_by_more_than_is_told_are_that_noisy(hertz: float, seed: int) -> None:
    """By 1 mm, 0.7 mm in the root of the mean square, where 0.3 mm are told and neighbours differ by less.

    Swings of which a stride is half a period count for up to twice as much.
    """
    shaken = (
        (t, moment._replace(seen=_shaken(moment.seen, 1e-3 * math.sin(2.0 * math.pi * hertz * t))))
        for t, moment in frames(seed, 0.8, seconds=15.0)
    )
    found = scales(learned(shaken), since=8.0)[:, 0] * TOLD.position
    assert np.all((found > 0.6e-3) & (found < 1.6e-3))


def at_chance(seed: int, fastest: float, every: float, lag: float) -> Speed:
    """Another speed every so often [s], followed with a lag [s]."""
    t = np.arange(0.0, 20.0, 0.002)
    wanted = np.random.default_rng(seed).uniform(0.0, fastest, len(t))[np.int64(t / every)]
    got = np.empty_like(t)
    now = 0.0
    for k, goal in enumerate(wanted.tolist()):
        now += (goal - now) * (1.0 - math.exp(-0.002 / lag))
        got[k] = now
    return lambda at: float(np.interp(at, t, got))


@pytest.mark.parametrize("rate", [20.0, 50.0, 120.0, 240.0])
@pytest.mark.parametrize("fastest", [0.2, 2.0])
@pytest.mark.parametrize(("every", "lag"), [(0.7, 0.03), (0.7, 0.1), (2.0, 0.03), (5.0, 0.1)])
def test_no_driving_passes_for_rocking(every: float, lag: float, fastest: float, rate: float) -> None:
    """However fast and abrupt: what strides find is no more than what neighbouring frames do."""
    speed = at_chance(1, fastest, every, lag)
    for t, estimate in learned(frames(1, 1.0, seconds=15.0, speed=speed, rate=rate)):
        by_frame = max(1.0, math.sqrt(estimate.by_frame.position.ratio))
        assert estimate.scale.position < 1.1 * by_frame, (t, estimate.scale)


def _shaken(seen: PairSeen, by: float) -> PairSeen:
    own = seen.follower._replace(x=seen.follower.x + by, y=seen.follower.y + by)
    return PairSeen(seen.leader_x + by, seen.leader_y + by, own)


def test_frames_out_of_order_and_of_one_moment_change_nothing() -> None:
    *before, last = frames(1, 1.0, seconds=2.0)
    estimate = learned(iter([*before, last]))[-1][1]
    for late in (last, before[-1], before[-7]):
        assert noise_with_frame(estimate, late[1], False, LEARNING) == estimate


def test_one_frame_that_is_not_believed_is_left_out_and_several_are_not() -> None:
    estimate = learned(frames(1, 1.0, seconds=2.0))[-1][1]
    _, moment = list(frames(1, 1.0, seconds=2.1))[-1]
    once = noise_with_frame(estimate, moment, True, LEARNING)
    assert once == estimate._replace(gated=True)
    later = moment._replace(capture_ns=moment.capture_ns + 8_333_333)
    assert noise_with_frame(once, later, True, LEARNING).frames.a == later


def test_bounds_of_the_search_are_kept_to() -> None:
    most, least = (learned(frames(1, true))[-1][1].scale.position for true in (300.0, 1e-6))
    assert most <= MOST_SCALE
    assert most > REFUTED
    assert LEAST_SCALE <= least < 0.25


def test_when_frames_before_are_forgotten_what_they_told_is_not() -> None:
    found = learned(frames(1, 3.0, seconds=3.0))[-1][1]
    kept = kept_noise(found)
    assert kept.scale == found.scale
    assert (kept.by_frame, kept.by_stride) == (found.by_frame, found.by_stride)
    assert (kept.frames.held, kept.strides.held) == (0, 0)
    assert scaled_noise(TOLD, kept) == PoseNoise(
        TOLD.position * kept.scale.position, TOLD.heading * kept.scale.heading
    )


@pytest.mark.parametrize(
    ("scale", "another"), [(0.48, True), (0.55, False), (1.0, False), (1.8, False), (2.1, True)]
)
def test_noise_is_another_one_from_twice_on(scale: float, another: bool) -> None:
    found = NOISE_AS_TOLD._replace(scale=NOISE_AS_TOLD.scale._replace(position=2.0 * scale), basis=2.0)
    assert is_another(found) == another
