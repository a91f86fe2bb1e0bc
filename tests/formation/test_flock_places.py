"""Places of a flock: their lattice, and that whom one may follow makes an order from the leader outwards."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.flock_places import LEAST_BEARING, may_follow, skein


@given(st.integers(2, 300), st.floats(0.1, 5.0))
def test_the_next_place_is_one_spacing_away(agents: int, spacing: float) -> None:
    places = skein(agents, spacing)
    assert places.shape == (agents, 2)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    np.fill_diagonal(apart, np.inf)
    np.testing.assert_allclose(apart.min(axis=1), spacing)


def test_full_wings_are_mirror_images_and_lie_between_the_edges() -> None:
    places = skein(109, 0.5)
    right, left = places[1::2], places[2::2]
    np.testing.assert_array_equal(right * (1.0, -1.0), left)
    seen = np.arctan2(left[:, 1], -left[:, 0])
    assert (seen.min(), seen.max()) == pytest.approx((math.pi / 6.0, math.pi / 3.0))


@given(st.integers(2, 300))
def test_everyone_is_led_and_nobody_in_a_circle(agents: int) -> None:
    allowed = may_follow(skein(agents, 0.5))
    assert not np.any(np.triu(allowed))
    led = np.zeros(agents, dtype=bool)
    led[0] = True
    for agent in range(1, agents):
        assert led[allowed[agent]].all()
        led[agent] = allowed[agent].any()
    assert led.all()


@given(st.integers(3, 200), st.data())
def test_the_mean_of_any_whom_one_may_follow_is_seen_in_the_cone(agents: int, data: st.DataObject) -> None:
    places = skein(agents, 1.0)
    allowed = may_follow(places)
    agent = data.draw(st.integers(1, agents - 1))
    whom = data.draw(st.lists(st.sampled_from(np.flatnonzero(allowed[agent]).tolist()), min_size=1))
    ahead, left = places[whom].mean(axis=0) - places[agent]
    on_the_right = places[agent, 1] < 0.0
    bearing = math.atan2(left if on_the_right else -left, ahead)
    assert LEAST_BEARING - 1e-9 <= bearing <= 0.5 * math.pi + 1e-9


def test_a_line_abreast_follows_inwards() -> None:
    places = np.array([(0.0, 0.0), (0.0, -1.0), (0.0, 1.0), (0.0, -2.0)])
    inwards = [[False] * 4, [True, *[False] * 3], [True, *[False] * 3], [True, True, False, False]]
    np.testing.assert_array_equal(may_follow(places), inwards)


def test_what_makes_no_flock_is_refused() -> None:
    with pytest.raises(ValueError, match="flock of 1"):
        skein(1, 0.5)
    with pytest.raises(ValueError, match=r"agent 4 .* sees nobody"):
        may_follow(skein(20, 0.5), 0.6)
    with pytest.raises(ValueError, match="out of order"):
        may_follow(np.array([(0.0, 0.0), (0.0, -2.0), (0.0, -1.0)]))
