from __future__ import annotations

import math
from typing import cast

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from estimation.bounds.window_velocity import NO_WINDOW, WindowVelocity, window_velocity
from estimation.filters.belief import Model
from estimation.filters.filter import Kind, filter_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_body, measure_world
from estimation.tracking.track import Track, Tracker
from estimation.tracking.track_point import TrackPoint
from estimation.tracking.track_settings import TrackSettings
from formation.pose import Pose
from formation.records import Rows
from formation.ring import Ring

LIMITS = LeaderLimits(0.04, 0.1, 0.7)
PERIOD_NS = 8_333_333
STILL = FollowerMotion(0.0, 0.0, 0.005, 0.03)
A = LIMITS.k_v * LIMITS.k_u


def tracker(kind: Kind = Kind.EKF, front_end: FrontEnd = FrontEnd.WORLD) -> Tracker:
    model = Model(front_end, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
    return Tracker(filter_of(kind, model), TrackSettings())


def at(k: int, place: complex) -> Measurement:
    noise = PoseNoise(3e-4, 3.5e-3)
    return measure_world(k * PERIOD_NS, (place.real, place.imag), Pose(1.0, 1.0, 0.0), noise, STILL)


def followed(places: list[complex], of: Tracker) -> Track:
    track: Track = ()
    for k, place in enumerate(places):
        track, _ = of.add(track, at(k + 1, place))
    return track


def seen_by(track: Track, longest: float = 0.3) -> WindowVelocity:
    room = 1 << len(track).bit_length()
    points = [*track, *[track[-1]] * (room - len(track))]
    return window_velocity(cast("Rows[TrackPoint]", points), Ring(0, len(track)), longest)


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from([Kind.EKF, Kind.UKF, Kind.DIFFERENCE]),
    longest=st.floats(0.02, 0.3),
)
def test_no_filter_errs_by_more_than_its_distance_and_the_differences_error(
    seed: int, kind: Kind, longest: float
) -> None:
    """Leaders that push as hard as they can, this way and that, and noise on its bound in any direction."""
    random, eps, h = np.random.default_rng(seed), 1.2e-3, PERIOD_NS * 1e-9
    place, velocity, push = 0.0j, 0.06 + 0.0j, A + 0.0j
    places, truth = [], []
    for _ in range(60):
        if random.random() < 0.1:
            push = A * np.exp(2j * math.pi * random.random())
        place, velocity = place + velocity * h + 0.5 * push * h * h, velocity + push * h
        truth.append((place, velocity))
        places.append(complex(place + eps * np.exp(2j * math.pi * random.random())))
    track = followed(places, tracker(kind))
    window, belief = seen_by(track, longest), track[-1].belief
    assume(window.span > 0.0)
    difference, since = 2.0 * eps / window.span + 0.5 * A * window.span, window.since
    allowed = difference + A * since
    true_place, true_velocity = truth[-1]
    error = abs(complex(belief.vx, belief.vy) - true_velocity)
    assert error <= window.gap + allowed + 1e-12
    assert abs(window.speed - abs(true_velocity)) <= allowed + 1e-12
    led = eps + since * (difference + 0.5 * A * since)
    assert abs(complex(belief.x, belief.y) - true_place) <= window.place + led + 1e-12


def test_the_window_is_the_longest_that_fits() -> None:
    track = followed([0.1 * k * PERIOD_NS * 1e-9 + 0.0j for k in range(60)], tracker())
    assert seen_by(track, 1.0).span == pytest.approx(0.2, abs=PERIOD_NS * 1e-9)
    assert seen_by(track, 0.1).span == pytest.approx(12 * PERIOD_NS * 1e-9, rel=1e-9)
    assert seen_by(track).speed == pytest.approx(0.1, rel=1e-9)
    assert not seen_by(track).jumped


def test_what_the_gate_turned_away_is_no_measured_position() -> None:
    places = [0.1 * k * PERIOD_NS * 1e-9 + 0.0j for k in range(60)]
    spoilt = [*places[:-1], places[-1] + 0.5]
    track = followed(spoilt, tracker())
    found = seen_by(track)
    assert found.since == pytest.approx(PERIOD_NS * 1e-9, rel=1e-9)
    assert found.speed == pytest.approx(0.1, rel=1e-9)
    assert found.place < 1e-4
    spoilt = [*places[:40], places[40] + 0.5, *places[41:]]
    track = followed(spoilt, tracker())
    longest = (len(places) - 1 - 40) * PERIOD_NS * 1e-9 + 1e-6
    assert seen_by(track, longest).speed == pytest.approx(0.1, rel=1e-6)


def test_a_single_point_or_axes_that_turn_give_no_window() -> None:
    assert seen_by(followed([0.0j], tracker())) == NO_WINDOW
    body = tracker(front_end=FrontEnd.BODY)
    track: Track = ()
    for k in range(1, 20):
        track, _ = body.add(track, measure_body(k * PERIOD_NS, 0.2, 0.5 * math.pi, 0.01, 0.02, STILL))
    assert seen_by(track) == NO_WINDOW
