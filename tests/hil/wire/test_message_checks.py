from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from controllers.guard import CLOCK_TOLERANCE_NS
from formation.pose import Pose
from formation.records import Rows, plain_rows_of, store
from hil.wire.message_checks import (
    ANY_TIME_NS,
    FARTHEST,
    FASTEST,
    HARDEST,
    Cause,
    check_frame,
    check_odometry,
    check_sighting,
    is_estimate,
    place_cause,
    planar,
)
from hil.wire.records import (
    Body,
    CheckedMotion,
    EstimateNumbers,
    Frame,
    FrameHead,
    Odometry,
    Placement,
    RangeAndBearing,
    ReadEstimate,
    Sighting,
    Stamp,
    Wanted,
)

LATEST_NS = 5_000_000_007
SOUND, NUMBER, STRANGERS = Stamp(5, 7), 41, 3
LEADER, FOLLOWER = 1, 2
COORDINATES = Placement._fields


def place(**changes: float) -> Placement:
    """A robot at (1, -2) that looks along x, with single coordinates changed."""
    return Placement(1.0, -2.0, 0.5, 0.0, 0.0, 0.0, 1.0)._replace(**changes)


SEEN_ONCE = Body(1, place())


def bodies(leader: Body, follower: Body) -> Rows[Body]:
    rows = plain_rows_of(Body, 3)
    for k, body in enumerate([Body(9, place(x=math.nan)), leader, follower]):
        store(rows, k, body)
    return rows


def checked(
    leader: Body = SEEN_ONCE,
    follower: Body = SEEN_ONCE,
    stamp: Stamp = SOUND,
    sound: bool = True,
    strangers: int = STRANGERS,
) -> Frame:
    head = FrameHead(sound, stamp, NUMBER, strangers)
    return check_frame(head, bodies(leader, follower), Wanted(LEADER, FOLLOWER, LATEST_NS))


def refused(
    cause: Cause, capture_ns: int = LATEST_NS, number: int = NUMBER, strangers: int = STRANGERS
) -> Frame:
    return Frame(cause, capture_ns, number, strangers, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_causes_keep_their_numbers() -> None:
    """Logs and messages count by the words, kernels by the numbers."""
    assert [(cause.value, cause.word) for cause in Cause] == [
        (0, "accepted"),
        (1, "malformed"),
        (2, "bad_stamp"),
        (3, "unknown_body"),
        (4, "missing_leader"),
        (5, "missing_follower"),
        (6, "duplicate_body"),
        (7, "not_finite"),
        (8, "out_of_range"),
        (9, "bad_quaternion"),
        (10, "tilted"),
        (11, "bad_range"),
    ]


def test_a_sound_frame_gives_place_of_the_leader_and_pose_of_the_follower() -> None:
    turned = place(x=3.0, y=4.0, qz=math.sin(0.35), qw=math.cos(0.35))
    found = checked(leader=Body(1, place(qz=math.sin(0.2), qw=math.cos(0.2))), follower=Body(1, turned))
    assert found[:-1] == (Cause.ACCEPTED, LATEST_NS, NUMBER, STRANGERS, 1.0, -2.0, 3.0, 4.0)
    assert found.follower_theta == pytest.approx(0.7, abs=1e-15)


def test_a_frame_that_is_not_whole_gives_nothing_of_itself() -> None:
    assert checked(sound=False) == refused(Cause.MALFORMED, 0, 0, 0)


@pytest.mark.parametrize("stamp", [Stamp(-1, 7), Stamp(5, -1), Stamp(4, 10**9), Stamp(5, 8), Stamp(6, 0)])
def test_a_stamp_that_is_no_time_or_lies_in_the_future_is_no_capture_time(stamp: Stamp) -> None:
    assert checked(stamp=stamp) == refused(Cause.BAD_STAMP, 0)


@pytest.mark.parametrize("stamp", [Stamp(0, 0), Stamp(4, 10**9 - 1), SOUND])
def test_any_time_up_to_the_latest_is_one(stamp: Stamp) -> None:
    found = checked(stamp=stamp)
    assert (found.cause, found.capture_ns) == (Cause.ACCEPTED, stamp.sec * 10**9 + stamp.nanosec)


@pytest.mark.parametrize(
    ("leaders", "followers", "strangers", "cause"),
    [
        (1, 1, 0, Cause.ACCEPTED),
        (2, 1, 0, Cause.DUPLICATE_BODY),
        (1, 2, 0, Cause.DUPLICATE_BODY),
        (0, 2, 0, Cause.DUPLICATE_BODY),
        (0, 0, 1, Cause.UNKNOWN_BODY),
        (0, 0, 0, Cause.MISSING_LEADER),
        (0, 1, 1, Cause.MISSING_LEADER),
        (1, 0, 0, Cause.MISSING_FOLLOWER),
        (1, 0, 1, Cause.MISSING_FOLLOWER),
    ],
)
def test_a_pair_is_each_body_once(leaders: int, followers: int, strangers: int, cause: Cause) -> None:
    found = checked(Body(leaders, place()), Body(followers, place()), strangers=strangers)
    assert found.cause == cause
    if cause != Cause.ACCEPTED:
        assert found == refused(cause, strangers=strangers)


@pytest.mark.parametrize(
    ("bad", "cause"),
    [
        *[({name: bad}, Cause.NOT_FINITE) for name in COORDINATES for bad in (math.nan, math.inf, -math.inf)],
        *[({name: far}, Cause.OUT_OF_RANGE) for name in COORDINATES for far in (1.0001e4, -1.0001e4)],
        ({"qw": 0.9899}, Cause.BAD_QUATERNION),
        ({"qw": 1.0101}, Cause.BAD_QUATERNION),
        ({"qx": 0.2}, Cause.BAD_QUATERNION),
        ({"qy": 0.2}, Cause.BAD_QUATERNION),
        ({"qz": 0.2}, Cause.BAD_QUATERNION),
        ({"qw": 0.0}, Cause.BAD_QUATERNION),
        ({"qx": math.sin(0.2619), "qw": math.cos(0.2619)}, Cause.TILTED),  # half of 30.01 degrees
        ({"qy": math.sin(0.2619), "qw": math.cos(0.2619)}, Cause.TILTED),
        ({"qx": 1.0, "qw": 0.0}, Cause.TILTED),
    ],
)
def test_a_place_that_is_none_refuses_the_frame_whosever_it_is(bad: dict[str, float], cause: Cause) -> None:
    assert place_cause(place(**bad)) == cause
    assert checked(follower=Body(1, place(**bad))) == refused(cause)
    lacks_orientation = cause == Cause.BAD_QUATERNION or (
        cause in (Cause.NOT_FINITE, Cause.OUT_OF_RANGE) and bad.keys() & {"qx", "qy", "qz", "qw"}
    )
    assert checked(leader=Body(1, place(**bad))).cause == (Cause.ACCEPTED if lacks_orientation else cause)


@pytest.mark.parametrize("none", [0.0, math.nan])
def test_of_a_leader_without_orientation_the_position_is_taken(none: float) -> None:
    marker = place(x=1.5, qx=none, qy=none, qz=none, qw=none)
    found = checked(leader=Body(1, marker))
    assert (found.cause, found.leader) == (Cause.ACCEPTED, (1.5, place().y))
    assert planar(marker) == Pose(1.5, place().y, 0.0)


@pytest.mark.parametrize(
    "good",
    [
        *[{name: far} for name in ("x", "y", "z") for far in (FARTHEST, -FARTHEST)],
        {"qw": 0.9901},
        {"qw": 1.0099},
        {"qw": -1.0},
        {"qx": math.sin(0.2617), "qw": math.cos(0.2617)},  # half of 29.99 degrees
        {"qy": math.sin(0.2617), "qw": math.cos(0.2617)},
        # A tilt is one whatever the norm is.
        {"qx": 1.009 * math.sin(0.2617), "qw": 1.009 * math.cos(0.2617)},
        {"qy": 1.009 * math.sin(0.2617), "qw": 1.009 * math.cos(0.2617)},
        {"qx": math.sin(0.18), "qy": math.sin(0.18), "qw": math.sqrt(1.0 - 2.0 * math.sin(0.18) ** 2)},
        {"qz": math.sin(1.5), "qw": math.cos(1.5)},
    ],
)
def test_a_place_that_just_holds_is_one(good: dict[str, float]) -> None:
    assert place_cause(place(**good)) == Cause.ACCEPTED


@pytest.mark.parametrize("size", [0.995, 1.0, 1.005])
def test_the_heading_is_that_of_the_x_axis_turned_by_the_quaternion(size: float) -> None:
    yaw, roll = 0.9, 0.3
    # First the roll about x, then the yaw about z: the x axis only turns.
    half = (math.sin(yaw / 2), math.cos(yaw / 2), math.sin(roll / 2), math.cos(roll / 2))
    turned = place(
        qx=size * half[1] * half[2],
        qy=size * half[0] * half[2],
        qz=size * half[0] * half[3],
        qw=size * half[1] * half[3],
    )
    found = planar(turned)
    assert (found.x, found.y) == (1.0, -2.0)
    assert found.theta == pytest.approx(yaw, abs=1e-14)
    pitched = planar(place(qy=size * math.sin(0.2), qw=size * math.cos(0.2)))
    assert pitched == Pose(1.0, -2.0, 0.0)


NUMBERS = [
    (math.nan, 0.1, Cause.NOT_FINITE),
    (0.1, math.nan, Cause.NOT_FINITE),
    (math.inf, 0.1, Cause.NOT_FINITE),
    (0.1, -math.inf, Cause.NOT_FINITE),
]


@pytest.mark.parametrize(
    ("v", "u", "cause"),
    [
        *NUMBERS,
        (FASTEST, -HARDEST, Cause.ACCEPTED),
        (-FASTEST, HARDEST, Cause.ACCEPTED),
        (1.001 * FASTEST, 0.0, Cause.OUT_OF_RANGE),
        (0.0, -1.001 * HARDEST, Cause.OUT_OF_RANGE),
        (900.0, 0.0, Cause.OUT_OF_RANGE),
        (0.1, 2.0 * math.pi / 0.05, Cause.OUT_OF_RANGE),  # a yaw that wraps between two samples at 20 Hz
    ],
)
def test_odometry_is_two_believable_numbers(v: float, u: float, cause: Cause) -> None:
    found = check_odometry(Odometry(True, SOUND, place(), v, u), LATEST_NS)
    assert found[:2] == (cause, LATEST_NS)
    if cause == Cause.ACCEPTED:
        assert found == CheckedMotion(cause, LATEST_NS, v, u, True, planar(place()))
    assert check_odometry(Odometry(False, SOUND, place(), v, u), LATEST_NS).cause == Cause.MALFORMED


@pytest.mark.parametrize(
    "bad",
    [place()._replace(x=math.nan), place()._replace(qw=0.0, qz=0.0), place()._replace(y=2.0 * FARTHEST)],
)
def test_a_pose_that_is_none_does_not_spoil_the_motion(bad: Placement) -> None:
    found = check_odometry(Odometry(True, SOUND, bad, 0.1, 0.2), LATEST_NS)
    assert found == CheckedMotion(Cause.ACCEPTED, LATEST_NS, 0.1, 0.2, False, Pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("rho", "alpha2", "cause"),
    [
        *NUMBERS,
        (FARTHEST, 3.0, Cause.ACCEPTED),
        (1e-9, -3.0, Cause.ACCEPTED),
        (1.0001 * FARTHEST, 0.0, Cause.OUT_OF_RANGE),
        (1.0, 1.0001 * FARTHEST, Cause.OUT_OF_RANGE),
        (0.0, 0.1, Cause.BAD_RANGE),
        (-1.0, 0.1, Cause.BAD_RANGE),
    ],
)
def test_a_sighting_is_a_bearing_and_a_distance_above_zero(rho: float, alpha2: float, cause: Cause) -> None:
    found = check_sighting(RangeAndBearing(True, SOUND, rho, alpha2), LATEST_NS)
    assert found[:2] == (cause, LATEST_NS)
    if cause == Cause.ACCEPTED:
        assert found == Sighting(cause, LATEST_NS, rho, alpha2)
    assert check_sighting(RangeAndBearing(False, SOUND, rho, alpha2), LATEST_NS).cause == Cause.MALFORMED


@pytest.mark.parametrize(
    ("stamp", "good"),
    [
        (SOUND, True),
        (Stamp(0, 0), True),
        (Stamp(5, 8), False),
        (Stamp(6, 0), False),
        (Stamp(-1, 0), False),
        (Stamp(4, 10**9), False),
    ],
)
def test_own_motion_and_sightings_have_a_time_up_to_the_latest(stamp: Stamp, good: bool) -> None:
    wanted = Cause.ACCEPTED if good else Cause.BAD_STAMP
    assert check_odometry(Odometry(True, stamp, place(), 0.1, 0.2), LATEST_NS).cause == wanted
    assert check_sighting(RangeAndBearing(True, stamp, 1.0, 0.2), LATEST_NS).cause == wanted


def estimate(sound: bool, status: int) -> ReadEstimate:
    numbers: Sequence[float] = [0] * len(EstimateNumbers._fields)
    return ReadEstimate(sound, 0, 0, EstimateNumbers._make(numbers)._replace(status=status))


def test_an_estimate_has_one_of_the_statuses_that_there_are() -> None:
    assert [is_estimate(estimate(True, status)) for status in range(7)] == [True] * 5 + [False] * 2
    assert not is_estimate(estimate(False, 0))


def test_any_time_is_later_than_every_stamp_and_a_number_of_64_bits() -> None:
    assert 2**31 * 10**9 <= ANY_TIME_NS < 2**63


def test_how_far_a_message_is_believed() -> None:
    """docs/lab.md tells people the tolerance of clocks."""
    assert (FARTHEST, FASTEST, HARDEST, CLOCK_TOLERANCE_NS) == (10_000.0, 20.0, 50.0, 50_000_000)
