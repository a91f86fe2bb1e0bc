"""Frames that are wrong as such, row by row; nothing is said of those that are right."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.nodes.frame_findings import ClockRule, axes_text, bodies_text, frame_findings, uprightness
from hil.nodes.frame_looks import KEPT_NS, Look, frame_id_in, names_in, recent, with_look
from hil.wire import message_types as msg
from hil.wire.messages import encode, header
from hil.wire.pose_sources import laid, upright
from hil.wire.records import Placement

S = 1_000_000_000
BEGIN_NS = 1_700_000_000 * S
RULE = ClockRule(True, 0.0, 0.2)
Change = Callable[[Look], Look]


def on_ground(x: float, y: float, heading: float, z: float = 0.1) -> Placement:
    return Placement(x, y, z, 0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))


def looks_of(change: Change = lambda look: look, moving: bool = True) -> list[Look]:
    """Six seconds of two robots that drive a curve, a fifth of a metre apart; frames are 30 ms old."""
    found = []
    for k in range(24):
        t = 0.25 * k if moving else 0.0
        at_ns = BEGIN_NS + k * S // 4
        leader = on_ground(0.2 * math.sin(0.5 * t), -0.2 * math.cos(0.5 * t), 0.5 * t)
        follower = on_ground(0.4 * math.sin(0.5 * t), -0.4 * math.cos(0.5 * t), 0.5 * t)
        found.append(change(Look(at_ns, at_ns - 30_000_000, "map", leader, follower)))
    return found


def both(change: Callable[[Placement], Placement]) -> Change:
    def changed(look: Look) -> Look:
        assert look.leader is not None
        assert look.follower is not None
        return look._replace(leader=change(look.leader), follower=change(look.follower))

    return changed


def stamped(stamp_ns: Callable[[Look], int]) -> Change:
    return lambda look: look._replace(stamp_ns=stamp_ns(look))


@pytest.mark.parametrize("moving", [True, False])
def test_nothing_is_said_of_what_is_right(moving: bool) -> None:
    assert frame_findings(looks_of(moving=moving), RULE) == {}
    assert frame_findings([], RULE) == {}


@pytest.mark.parametrize(
    ("change", "name", "word"),
    [
        (both(lambda place: laid(place, "y", 1.0)), "axes", "y is up"),
        (
            both(lambda place: laid(place, "y", 1.0)._replace(qx=0.0, qy=0.0, qz=0.0, qw=0.0)),
            "axes",
            "y is up",
        ),
        (both(lambda place: laid(place, "z", 0.001)), "unit", "millimetres"),
        (both(lambda place: laid(place, "y", 0.001)), "unit", "millimetres"),
        (stamped(lambda look: look.stamp_ns + S), "clock", "0.97 s ahead"),
        (stamped(lambda look: look.stamp_ns - 300 * S), "clock", "300 s old"),
        (stamped(lambda look: BEGIN_NS), "clock", "stand still"),
        (stamped(lambda look: 0), "clock", "no stamps"),
        (
            lambda look: look._replace(frame_id=f"odom{look.at_ns % 2}" if look.at_ns % 500_000_000 else "b"),
            "frames_of_reference",
            "'b', 'odom0'",
        ),
    ],
)
def test_each_thing_that_is_wrong_is_named(change: Change, name: str, word: str) -> None:
    found = frame_findings(looks_of(change), RULE)
    assert word in found[name]
    assert "expected" in found[name]


def test_axes_are_told_of_robots_that_stand_but_do_not_face_along_x() -> None:
    def turned(place: Placement) -> Placement:
        return laid(on_ground(place.x, place.y, 1.0), "y", 1.0)

    assert "y is up" in frame_findings(looks_of(both(turned), moving=False), RULE)["axes"]


def test_a_clock_that_is_estimated_may_be_off_and_must_go() -> None:
    rule = RULE._replace(trusted=False)
    assert frame_findings(looks_of(stamped(lambda look: look.stamp_ns - 300 * S)), rule) == {}
    assert "clock" in frame_findings(looks_of(stamped(lambda look: BEGIN_NS)), rule)


@given(st.floats(-math.pi, math.pi), st.floats(-0.2, 0.2), st.floats(0.0, 0.08))
def test_robots_on_uneven_ground_are_not_called_tilted(heading: float, tilt: float, bump: float) -> None:
    track = [
        Placement(0.1 * k, 0.0, bump * (k % 2), math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2))
        if k % 2
        else on_ground(0.1 * k, 0.02 * k, heading, 0.0)
        for k in range(12)
    ]
    assert axes_text("leader", track) == ""


@given(st.floats(-math.pi, math.pi))
def test_what_is_put_upright_is(heading: float) -> None:
    place = laid(on_ground(1.0, 2.0, heading), "y", 1.0)
    assert uprightness(place)[1] == pytest.approx(1.0)
    assert uprightness(place)[2] == pytest.approx(math.cos(heading))
    assert uprightness(upright(place, "y", 1.0))[2] == pytest.approx(1.0)


def test_numbers_that_are_none_say_nothing() -> None:
    nowhere = Placement(*[math.nan] * 7)
    assert axes_text("leader", [nowhere] * 20) == ""
    assert frame_findings(looks_of(both(lambda _: nowhere)), RULE) == {}


def test_bodies_are_called_by_the_names_seen_and_wanted() -> None:
    assert (
        bodies_text(["leader", "follower"], ["1", "2"])
        == "no body 'leader', 'follower' among those seen: '1', '2'"
    )
    assert bodies_text(["a", "b"], ["b", "a", "x"]) == ""
    assert "more than one" in bodies_text(["a", "b"], ["b", "a", "b"])


def test_frame_and_names_are_read_from_the_payload() -> None:
    place = msg.Pose(msg.Point(0.0, 0.0, 0.0), msg.Quaternion(0.0, 0.0, 0.0, 1.0))
    frame = msg.RigidBodies(header(5, "hall"), 0, [msg.RigidBody("1", [], place)])
    assert frame_id_in(encode(frame)) == "hall"
    assert names_in(encode(frame)) == ("1",)
    assert frame_id_in(b"") == ""
    assert names_in(b"?") == ()


def test_old_looks_are_let_go() -> None:
    kept: tuple[Look, ...] = ()
    for look in looks_of():
        kept = with_look(kept, look)
    assert len(kept) == 24
    later = kept[-1]._replace(at_ns=kept[-1].at_ns + KEPT_NS)
    assert with_look(kept, later) == (later,)
    back = kept[0]._replace(at_ns=kept[0].at_ns - 1)
    assert with_look(kept, back) == (back,)
    assert recent(kept, kept[-1].at_ns) == kept
