from __future__ import annotations

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire.message_checks import planar
from hil.wire.messages import MalformedPayloadError, encode, header, typename_of
from hil.wire.pose_sources import (
    MESSAGES,
    NamedPlace,
    laid,
    message_of,
    places_in,
    places_of,
    source_type,
    upright,
)
from hil.wire.records import Placement

TYPES: tuple[SourceType, ...] = get_args(SourceType)
NUMBERS = st.floats(-1e3, 1e3)
PLACES = st.builds(Placement, *[NUMBERS] * 7)
STAMP_NS = 1_700_000_000_123_456_789


def test_there_is_a_message_for_every_type_of_source_and_it_is_known_again() -> None:
    assert tuple(MESSAGES) == TYPES or set(MESSAGES) == set(TYPES)
    assert {name: source_type(typename_of(kind)) for name, kind in MESSAGES.items()} == {n: n for n in TYPES}
    assert source_type("std_msgs/msg/String") is None


@given(st.sampled_from(TYPES), st.lists(st.tuples(st.text("abc 12", min_size=1), PLACES), min_size=1))
def test_what_is_told_in_a_message_is_read_from_it(
    kind: SourceType, bodies: list[tuple[str, Placement]]
) -> None:
    told = message_of(kind, header(STAMP_NS, "lab"), bodies)
    single = kind not in ("RigidBodies", "NamedPoseArray", "TFMessage")
    wanted = bodies[:1] if single else bodies
    read = places_in(kind, encode(told), bodies[0][0] if single else "")
    assert read == [NamedPlace(name, STAMP_NS, "lab", place) for name, place in wanted]


@pytest.mark.parametrize("kind", TYPES)
@given(junk=st.binary(max_size=200))
def test_junk_is_malformed_whatever_the_type(kind: SourceType, junk: bytes) -> None:
    try:
        places_in(kind, junk)
    except MalformedPayloadError:
        return


@given(PLACES, st.sampled_from(["z", "y"]), st.sampled_from([1.0, 0.001, 0.01, 0.0254]))
def test_a_place_comes_back_from_the_axes_and_the_unit_of_a_source(
    place: Placement, up: str, scale: float
) -> None:
    back = upright(laid(place, up, scale), up, scale)
    assert back == pytest.approx(place, rel=1e-12, abs=1e-9)


@given(st.floats(-math.pi, math.pi), st.floats(-0.3, 0.3))
def test_y_up_is_z_up_turned_about_x(yaw: float, tilt: float) -> None:
    """An independent rotation: by 90 degrees about x, of the world's axes and of the body's own."""
    turn = Rotation.from_euler("x", 90, degrees=True)
    body = Rotation.from_euler("yx", [yaw, tilt])
    found = upright(Placement(1.0, 2.0, 3.0, *body.as_quat()), "y", 1.0)
    assert found[:3] == pytest.approx(turn.apply([1.0, 2.0, 3.0]))
    wanted = turn * body * turn.inv()
    assert (Rotation.from_quat(found[3:]).inv() * wanted).magnitude() == pytest.approx(0.0, abs=1e-7)
    level = upright(Placement(0.0, 0.0, 0.0, *Rotation.from_euler("y", yaw).as_quat()), "y", 1.0)
    assert math.cos(planar(level).theta - yaw) == pytest.approx(1.0)


def test_a_message_that_tells_no_pose_tells_none() -> None:
    assert places_of(msg.String(data="hello")) == []
