"""A law of one's own is asked as the shipped ones are, on either side."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.laws import Gains, ideal, independent, law
from controllers.limits import Limits
from controllers.own_law import GIVEN, Leader, OwnLaw, SeenShape, Shape, gains_type
from formation.line import line_of
from formation.shape import Shape as PlainShape
from formation.spacing import Spacing
from formation.station import Side, Station

SPACING = Spacing(0.5, 3.0)
LIMITS = Limits(0.22, 2.84)


def prop2(shape: SeenShape, leader: Leader, gains: Any) -> tuple[float, float]:
    f = gains.mu_rho * ((shape.rho - gains.rho_0) / shape.rho) * ((shape.rho + gains.rho_0) / shape.rho)
    v2 = -leader.v1 * shape.sin1 + shape.rho * (leader.v1 * f - gains.mu1 * shape.cos1)
    driven = max(-gains.v_max, min(gains.v_max, v2))
    line_rate = (leader.v1 * shape.sin1 + driven * shape.sin2) / shape.rho
    return v2, line_rate - gains.mu2 * shape.cos2


def told(shape: SeenShape, leader: Leader, gains: Any) -> tuple[float, float]:
    return shape.alpha1 + gains.k, leader.u1


OWN, TOLD = OwnLaw(prop2, "prop2"), OwnLaw(told, "told", {"k": 0.25})

shapes = st.builds(PlainShape, st.floats(0.05, 3.0), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))


@given(shapes, st.floats(0.0, 0.3), st.sampled_from(Side))
def test_prop_2_of_ones_own_gives_the_bits_of_the_shipped_one(
    shape: PlainShape, v1: float, side: Side
) -> None:
    shipped = Gains(1.2, 2.3, SPACING, Station(side))
    own = Gains(1.2, 2.3, SPACING, Station(side), own=OWN)
    assert independent(shape, v1, 0.0, own, LIMITS) == independent(shape, v1, 0.0, shipped, LIMITS)
    assert independent(shape, v1, 0.0, own) == independent(shape, v1, 0.0, shipped)


@given(shapes, st.floats(-1.0, 1.0))
def test_on_the_left_it_is_asked_with_the_mirror_image(shape: PlainShape, u1: float) -> None:
    right = Gains(1.0, 2.0, SPACING, own=TOLD)
    left = Gains(1.0, 2.0, SPACING, Station(Side.LEFT), own=TOLD)
    mirrored = PlainShape(shape.rho, -shape.alpha1, -shape.alpha2)
    there, here = ideal(mirrored, 0.1, -u1, left), ideal(shape, 0.1, u1, right)
    assert (there.v, there.u) == (here.v, -here.u)


def test_parameters_are_its_gains_and_can_be_changed_without_compiling_it_anew() -> None:
    other = TOLD.with_parameters({"k": 1.0})
    shape, line = PlainShape(0.5, -0.3, 1.0), line_of(PlainShape(0.5, -0.3, 1.0))
    for each, k in ((TOLD, 0.25), (other, 1.0)):
        motion = law(Gains(1.0, 2.0, SPACING, own=each).settings(), line, 0.1, 0.7)
        assert motion.v == pytest.approx(shape.alpha1 + k)
        assert motion.u == 0.7
    assert TOLD.at(*range(7)).function == other.at(*range(7)).function


@pytest.mark.parametrize("name", ["mu1", "rho_0", "two words", "_hidden", "class"])
def test_a_parameter_needs_a_name_of_its_own(name: str) -> None:
    with pytest.raises(ValueError, match="expected a name of its own"):
        OwnLaw(told, "told", {name: 1.0})


def test_a_shape_by_hand_has_what_the_loop_gives() -> None:
    shape = Shape(0.5, -1.0, 2.0)
    assert shape == SeenShape(
        0.5, -1.0, 2.0, *map(float, (math.cos(-1.0), math.sin(-1.0), math.cos(2.0), math.sin(2.0)))
    )
    v2, u2 = prop2(shape, Leader(0.1, 0.0), gains_type(())(1.0, 2.0, 3.0, 0.5, math.pi / 2, 0.22, 2.84))
    assert math.isfinite(v2 + u2)
    assert len(GIVEN) == 7
