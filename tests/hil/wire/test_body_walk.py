"""What a guard sees of a mocap frame, against the general codec."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from hil.wire import message_types as msg
from hil.wire.body_walk import Spot, spots_in
from hil.wire.messages import MalformedPayloadError, decode_as, encode, header

NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
NAMES = st.text(max_size=12).filter(lambda name: "\0" not in name and name.isprintable())
MARKERS = st.lists(st.tuples(st.integers(-128, 127), st.integers(-(2**31), 2**31 - 1), NAMES), max_size=3)
BODIES = st.lists(st.tuples(NAMES, MARKERS, NUMBERS, NUMBERS), max_size=5)


def frame(bodies: list[tuple[str, list[tuple[int, int, str]], float, float]]) -> bytes:
    zero = msg.Point(x=0.0, y=0.0, z=0.0)
    turned = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    told = [
        msg.RigidBody(
            name,
            [msg.Marker(kind, index, label, zero) for kind, index, label in markers],
            msg.Pose(position=msg.Point(x=x, y=y, z=0.0), orientation=turned),
        )
        for name, markers, x, y in bodies
    ]
    return encode(msg.RigidBodies(header(5, "map"), 7, told))


@given(BODIES)
def test_all_bodies_with_a_finite_position_are_seen(
    bodies: list[tuple[str, list[tuple[int, int, str]], float, float]],
) -> None:
    seen = [Spot(name, x, y) for name, _, x, y in bodies if math.isfinite(x) and math.isfinite(y)]
    assert spots_in(frame(bodies)) == tuple(seen)


@given(BODIES, st.data())
def test_what_the_codec_refuses_has_none_and_nothing_raises(
    bodies: list[tuple[str, list[tuple[int, int, str]], float, float]], data: st.DataObject
) -> None:
    payload = bytearray(frame(bodies))
    for _ in range(data.draw(st.integers(0, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(payload[: data.draw(st.integers(0, len(payload)))])
    spots = spots_in(cut)
    assert all(math.isfinite(spot.x) and math.isfinite(spot.y) for spot in spots)
    if cut[:2] == b"\0\1":
        try:
            decode_as(cut, msg.RigidBodies)
        except MalformedPayloadError:
            assert spots == ()
