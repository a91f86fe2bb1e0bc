from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controllers.guard import CLOCK_TOLERANCE_NS
from formation.angles import wrap
from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.wire import message_types as msg
from hil.wire.message_checks import FARTHEST, FASTEST
from hil.wire.messages import encode, header
from hil.wire.reading import RefusedError, read_frame, read_odometry, read_sighting

NOW_NS = 1_700_000_000_000_000_000
STAMP_NS = NOW_NS - 30_000_000
angles = st.floats(-math.pi, math.pi, exclude_min=True)


def body(name: str, **changes: float) -> msg.RigidBody:
    """A body at (0.1, 0.2, 0) with heading zero, and single coordinates changed."""
    values = {"x": 0.1, "y": 0.2, "z": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0, **changes}
    return msg.RigidBody(
        name,
        [],
        msg.Pose(
            position=msg.Point(x=values["x"], y=values["y"], z=values["z"]),
            orientation=msg.Quaternion(x=values["qx"], y=values["qy"], z=values["qz"], w=values["qw"]),
        ),
    )


def frame(*bodies: msg.RigidBody, stamp_ns: int = STAMP_NS) -> bytes:
    return encode(msg.RigidBodies(header(stamp_ns, "mocap"), 7, list(bodies)))


def odometry(v: float, u: float, stamp_ns: int = STAMP_NS) -> bytes:
    return encode(odometry_message(stamp_ns, "follower", Pose(0.0, 0.0, 0.0), Motion(v, u)))


def sighting(rho: float, alpha2: float, stamp_ns: int = STAMP_NS) -> bytes:
    return encode(msg.RangeBearing(header(stamp_ns, "follower"), rho, alpha2))


def bad_time(payload_of: Callable[[msg.Header], msg.Message], sec: int, nanosec: int) -> bytes:
    return encode(payload_of(msg.Header(stamp=msg.Time(sec=sec, nanosec=nanosec), frame_id="")))


def cause_of(payload: bytes) -> str:
    with pytest.raises(RefusedError) as caught:
        read_frame(payload, "leader", "follower", NOW_NS)
    return caught.value.cause


@given(angles, angles)
@settings(deadline=None, max_examples=30)
def test_a_sound_frame_gives_the_pair(first: float, second: float) -> None:
    bodies = [
        ("leader", Pose(1.0, 2.0, first)),
        ("ball", Pose(0.0, 0.0, 0.0)),
        ("follower", Pose(3.0, 4.0, second)),
    ]
    found = read_frame(encode(frame_message(STAMP_NS, 9, bodies)), "leader", "follower", NOW_NS)
    assert (found.capture_ns, found.frame_number, found.leader) == (STAMP_NS, 9, (1.0, 2.0))
    assert (found.follower.x, found.follower.y, found.strangers) == (3.0, 4.0, 1)
    assert abs(wrap(found.follower.theta - second)) < 1e-14


@given(angles, st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
@settings(deadline=None)
def test_heading_is_the_yaw_of_a_slightly_tilted_body(yaw: float, pitch: float, roll: float) -> None:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat().tolist()
    tilted = body("follower", qx=x, qy=y, qz=z, qw=w)
    if math.cos(pitch) * math.cos(roll) < math.cos(math.radians(29.9)):
        return
    found = read_frame(frame(body("leader"), tilted), "leader", "follower", NOW_NS)
    assert abs(wrap(found.follower.theta - yaw)) < 1e-12


@pytest.mark.parametrize(
    ("payload", "cause"),
    [
        (b"", "malformed"),
        (b"\x01\x02\x03", "malformed"),
        (frame(body("leader"), body("follower"))[:-8], "malformed"),
        (frame(body("leader"), body("follower")) + bytes(64), "malformed"),
        (frame(body("cat"), body("dog")), "unknown_body"),
        (frame(body("follower")), "missing_leader"),
        (frame(), "missing_leader"),
        (frame(body("leader"), body("cat")), "missing_follower"),
        (frame(body("leader"), body("follower"), body("leader")), "duplicate_body"),
        (frame(body("leader", x=math.nan), body("follower")), "not_finite"),
        (frame(body("leader"), body("follower", qz=math.inf)), "not_finite"),
        (frame(body("leader", y=1.1 * FARTHEST), body("follower")), "out_of_range"),
        (frame(body("leader"), body("follower", qw=0.0)), "bad_quaternion"),
        (frame(body("leader"), body("follower", qw=0.9)), "bad_quaternion"),
        (frame(body("leader"), body("follower", qw=0.0, qx=1.0)), "tilted"),
        # Mocap with y up, as its makers ship it: a body on the floor seems to lie on its side.
        (frame(body("leader"), body("follower", qw=math.sqrt(0.5), qx=math.sqrt(0.5))), "tilted"),
        (frame(body("leader"), body("follower"), stamp_ns=NOW_NS + CLOCK_TOLERANCE_NS + 1), "bad_stamp"),
        (bad_time(lambda given: msg.RigidBodies(given, 1, []), -1, 0), "bad_stamp"),
        (bad_time(lambda given: msg.RigidBodies(given, 1, []), 5, 10**9), "bad_stamp"),
    ],
)
def test_a_frame_is_refused_by_its_cause(payload: bytes, cause: str) -> None:
    assert cause_of(payload) == cause


def test_clocks_may_differ_a_little() -> None:
    ahead = frame(body("leader"), body("follower"), stamp_ns=NOW_NS + CLOCK_TOLERANCE_NS)
    assert read_frame(ahead, "leader", "follower", NOW_NS).capture_ns == NOW_NS + CLOCK_TOLERANCE_NS


@pytest.mark.parametrize(
    ("payload", "cause"),
    [
        (b"\x00\x01\x00\x00\x07", "malformed"),
        (odometry(math.nan, 0.0), "not_finite"),
        (odometry(0.0, -math.inf), "not_finite"),
        (odometry(2.0 * FASTEST, 0.0), "out_of_range"),
        (odometry(0.1, 0.1, NOW_NS + 10**9), "bad_stamp"),
    ],
)
def test_odometry_is_refused_by_its_cause(payload: bytes, cause: str) -> None:
    with pytest.raises(RefusedError, match=f"^{cause}$"):
        read_odometry(payload, NOW_NS)


@pytest.mark.parametrize(
    ("payload", "cause"),
    [
        (odometry(0.1, 0.1), "malformed"),
        (sighting(math.nan, 0.0), "not_finite"),
        (sighting(1.0, math.inf), "not_finite"),
        (sighting(0.0, 1.0), "bad_range"),
        (sighting(-1.0, 1.0), "bad_range"),
        (sighting(2.0 * FARTHEST, 1.0), "out_of_range"),
        (sighting(1.0, 1.0, NOW_NS + 10**9), "bad_stamp"),
    ],
)
def test_sightings_are_refused_by_their_cause(payload: bytes, cause: str) -> None:
    with pytest.raises(RefusedError, match=f"^{cause}$"):
        read_sighting(payload, NOW_NS)


def test_sound_odometry_and_sightings_come_through() -> None:
    sample = read_odometry(odometry(0.1, -0.4), NOW_NS)
    assert (sample.stamp_ns, sample.v2, sample.u2) == (STAMP_NS, 0.1, -0.4)
    assert sample.has_pose
    seen = read_sighting(sighting(0.7, -2.0), NOW_NS)
    assert (seen.capture_ns, seen.rho, seen.alpha2) == (STAMP_NS, 0.7, -2.0)


SOUND = [frame(body("leader"), body("follower")), odometry(0.1, 0.2), sighting(0.5, 1.0)]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A sound payload with some bytes overwritten and its end cut or grown."""
    payload = bytearray(draw(st.sampled_from(SOUND)))
    for place in draw(st.lists(st.integers(0, len(payload) - 1), max_size=8)):
        payload[place] = draw(st.integers(0, 255))
    return bytes(payload[: draw(st.integers(0, len(payload)))]) + draw(st.binary(max_size=8))


@given(st.one_of(st.binary(max_size=300), damaged()))
@settings(deadline=None, max_examples=400)
def test_bytes_of_any_kind_are_read_or_refused_and_nothing_else(payload: bytes) -> None:
    for read in (
        lambda: read_frame(payload, "leader", "follower", NOW_NS),
        lambda: read_odometry(payload, NOW_NS),
        lambda: read_sighting(payload, NOW_NS),
    ):
        with contextlib.suppress(RefusedError):
            read()


orientations = st.tuples(angles, st.floats(-1.5, 1.5), angles)


@given(orientations, st.floats(0.9901, 1.0099))
@settings(deadline=None)
def test_a_body_is_tilted_when_its_axis_leans_by_more_than_30_degrees_to_any_side(
    turned: tuple[float, float, float], length: float
) -> None:
    rotation = Rotation.from_euler("ZYX", turned)
    x, y, z, w = (length * rotation.as_quat()).tolist()
    upright = float(rotation.apply([0.0, 0.0, 1.0])[2])
    payload = frame(body("leader"), body("follower", qx=x, qy=y, qz=z, qw=w))
    if upright < math.cos(math.radians(30.0)) - 1e-9:
        assert cause_of(payload) == "tilted"
    elif upright > math.cos(math.radians(30.0)) + 1e-9:
        forward = rotation.apply([1.0, 0.0, 0.0])
        found = read_frame(payload, "leader", "follower", NOW_NS).follower
        assert abs(wrap(found.theta - math.atan2(forward[1], forward[0]))) < 1e-9


@pytest.mark.parametrize("axis", ["qx", "qy"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_body_on_its_side_is_tilted_whichever_side_it_is(axis: str, sign: float) -> None:
    for degrees, fits in ((29.0, True), (31.0, False), (90.0, False), (180.0, False)):
        half = math.radians(0.5 * degrees)
        payload = frame(
            body("leader"), body("follower", **{axis: sign * math.sin(half), "qw": math.cos(half)})
        )
        if fits:
            assert read_frame(payload, "leader", "follower", NOW_NS).follower.theta == 0.0
        else:
            assert cause_of(payload) == "tilted"


@pytest.mark.parametrize("part", ["qx", "qy", "qz", "qw"])
@pytest.mark.parametrize(
    ("length", "fits"), [(0.9899, False), (0.9901, True), (1.0099, True), (1.0101, False)]
)
def test_a_quaternion_may_be_off_a_unit_by_a_hundredth(part: str, length: float, fits: bool) -> None:
    payload = frame(body("leader"), body("follower", **{"qw": 0.0, part: length}))
    if fits and part in ("qz", "qw"):
        theta = read_frame(payload, "leader", "follower", NOW_NS).follower.theta
        assert theta == pytest.approx(math.pi if part == "qz" else 0.0, abs=1e-12)
    else:
        assert cause_of(payload) == ("tilted" if fits else "bad_quaternion")


@pytest.mark.parametrize("part", ["x", "y", "z"])
@pytest.mark.parametrize("name", ["leader", "follower"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_ten_kilometres_are_the_farthest(part: str, name: str, sign: float) -> None:
    other = "follower" if name == "leader" else "leader"
    read_frame(frame(body(other), body(name, **{part: sign * 1e4})), "leader", "follower", NOW_NS)
    assert cause_of(frame(body(other), body(name, **{part: sign * 1.0001e4}))) == "out_of_range"
    assert cause_of(frame(body(other), body(name, **{part: sign * math.inf}))) == "not_finite"


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_no_robot_in_a_room_reaches_is_refused_and_ten_kilometres_are_the_longest_range(
    sign: float,
) -> None:
    for v, u in ((20.0, 0.0), (0.0, 50.0)):
        read_odometry(odometry(sign * v, sign * u), NOW_NS)
        with pytest.raises(RefusedError, match=r"^out_of_range$"):
            read_odometry(odometry(sign * 1.001 * v, sign * 1.001 * u), NOW_NS)
    assert read_sighting(sighting(1e4, sign * 1e4), NOW_NS).rho == 1e4
    assert read_sighting(sighting(1e-9, 0.0), NOW_NS).rho == 1e-9
    for rho, alpha2 in ((1.001e4, 0.0), (1.0, sign * 1.001e4)):
        with pytest.raises(RefusedError, match=r"^out_of_range$"):
            read_sighting(sighting(rho, alpha2), NOW_NS)


@pytest.mark.parametrize("read", [read_odometry, read_sighting])
def test_a_stamp_may_be_50_ms_ahead_and_no_more(read: Callable[[bytes, int], object]) -> None:
    for ahead_ns, fits in ((50_000_000, True), (50_000_001, False)):
        stamp_ns = NOW_NS + ahead_ns
        payload = odometry(0.1, 0.1, stamp_ns) if read is read_odometry else sighting(1.0, 1.0, stamp_ns)
        if fits:
            read(payload, NOW_NS)
        else:
            with pytest.raises(RefusedError, match=r"^bad_stamp$"):
                read(payload, NOW_NS)


def test_who_has_no_clock_takes_stamps_of_the_future() -> None:
    ahead = frame(body("leader"), body("follower"), stamp_ns=NOW_NS + 10**12)
    assert read_frame(ahead, "leader", "follower").capture_ns == NOW_NS + 10**12


def test_only_bodies_that_nobody_knows_are_strangers() -> None:
    pair = [body("leader"), body("follower")]
    payload = frame(body("cat"), *pair, body("dog"), body("ball"), body("dog"))
    assert read_frame(payload, "leader", "follower", NOW_NS).strangers == 4
    assert read_frame(payload, "leader", "follower", NOW_NS, others=("dog", "owl")).strangers == 2
    with pytest.raises(RefusedError, match=r"^missing_leader$"):
        read_frame(frame(body("dog")), "leader", "follower", NOW_NS, others=("dog",))
    with pytest.raises(RefusedError, match=r"^unknown_body$"):
        read_frame(frame(body("cat")), "leader", "follower", NOW_NS, others=("dog",))
