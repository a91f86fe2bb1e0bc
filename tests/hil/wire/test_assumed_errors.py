from __future__ import annotations

import math

import pytest

from estimation.bounds.window_velocity import NO_WINDOW, WindowVelocity
from estimation.tracking.estimate import Estimate, Joint
from estimation.tracking.track_point import NO_JUMP, JumpUncertainty
from hil.scenario.files import load_scenario
from hil.wire.assumed_errors import AssumedErrors, bounds_of

WINDOW = WindowVelocity(0.081, 0.004, 2e-4, 0.2, 0.0, False)
TOLD = Estimate(1, 1, 0.2, 1.57, 0.0, 0.0, 0.08, -1.57, 0.3, 0.1, 0.3, Joint(*[0.0] * 15), 2.0, 1, NO_JUMP)
WORLD = AssumedErrors.of(load_scenario("turtlebot3"))
EPS = 3.0 * math.sqrt(2.0) * 3e-4
"""Three standard deviations on both axes at once."""


def test_in_the_mocap_frame_positions_alone_bound_the_leader() -> None:
    found = bounds_of(TOLD, WORLD, WINDOW)
    difference = 2.0 * EPS / 0.2 + 0.5 * 0.1 * 0.7 * 0.2
    assert found.v1 == pytest.approx(difference + 0.001, rel=1e-12)
    line = math.asin((2e-4 + 2.0 * EPS) / 0.2)
    assert found.alpha1 == pytest.approx(math.asin((difference + 0.004) / 0.08) + line, rel=1e-12)
    other = bounds_of(TOLD._replace(v2=9.0, u2=-3.0, alpha2_dot=5.0), WORLD, WINDOW)
    assert other == found
    wilder = AssumedErrors.of(load_scenario("turtlebot3", ["estimator.sigma_v2=9", "estimator.sigma_u2=9"]))
    assert bounds_of(TOLD, wilder, WINDOW) == found


def test_the_nominal_robots_have_bounds_that_say_something() -> None:
    found = bounds_of(TOLD, WORLD, WINDOW)
    assert found.v1 < 0.022
    assert found.alpha1 < 0.4


def test_without_a_window_little_is_known() -> None:
    found = bounds_of(TOLD, WORLD, NO_WINDOW)
    assert found.v1 == pytest.approx(0.18)
    assert (found.alpha1, found.h) == (math.pi, math.inf)


def test_a_jump_may_be_an_error_of_its_size() -> None:
    jumped = TOLD._replace(jump=JumpUncertainty(0.01, 0.1, 5))
    still, between = (bounds_of(jumped, WORLD, WINDOW._replace(jumped=it)) for it in (False, True))
    sound = bounds_of(TOLD, WORLD, WINDOW)
    assert still.v1 == sound.v1
    assert still.alpha1 > sound.alpha1 + 0.04
    assert between.v1 == pytest.approx(sound.v1 + 0.01 / 0.2, rel=1e-12)


def test_along_the_followers_axes_its_own_motion_counts() -> None:
    body = AssumedErrors.of(load_scenario("turtlebot3", ["estimator.front_end=body"]))
    assert not body.in_world
    assert bounds_of(TOLD._replace(v2=0.5), body, WINDOW).v1 > bounds_of(TOLD, body, WINDOW).v1
    assert bounds_of(TOLD, body, WINDOW) == bounds_of(TOLD, body, NO_WINDOW)
