from __future__ import annotations

from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.live.coming_to_rest import ComingToRest, Rest, rest_words
from hil.scenario.files import load_scenario
from hil.wire.events import Event
from hil.wire.lab_robots import robots_of
from hil.wire.messages import encode

ROBOTS = robots_of(load_scenario("turtlebot3"))


def says(robot: str, own: Motion) -> Event:
    return Event(f"{robot}/odom", encode(odometry_message(5, robot, Pose(0.0, 0.0, 0.0), own)))


def test_a_robot_stands_since_it_last_came_to_rest() -> None:
    resting = ComingToRest(ROBOTS, 10.0)
    for v, now in ((0.0, 10.05), (0.1, 10.1), (0.004, 10.3), (0.002, 10.4)):
        resting.hear(says("leader", Motion(v, 0.0)), now)
    resting.hear(says("follower", Motion(0.12, 0.3)), 10.4)
    leader, follower = resting.rest(10.5)
    assert leader.words() == "leader stands (odometry 0.002 m/s, 0.00 rad/s after 0.3 s)"
    assert follower.words() == "follower was told to stand and still moves at 0.12 m/s"
    assert (leader.moves, follower.moves) == (False, True)


def test_of_a_robot_without_odometry_nothing_is_said_to_be_known() -> None:
    resting = ComingToRest(ROBOTS, 10.0)
    resting.hear(Event("leader/odom", b"?"), 10.1)
    resting.hear(Event("leader/cmd_vel", b"?"), 10.1)
    leader, follower = resting.rest(10.5)
    assert (leader, follower) == (Rest("leader"), Rest("follower"))
    assert leader.words() == "leader: nothing heard of its odometry: look at the robot"
    assert not leader.moves


def test_odometry_that_fell_silent_tells_of_no_standstill_but_of_a_robot_that_moved() -> None:
    resting = ComingToRest(ROBOTS, 10.0)
    resting.hear(says("leader", STANDSTILL), 10.1)
    resting.hear(says("follower", Motion(0.0, -0.3)), 10.1)
    leader, follower = resting.rest(12.0)
    assert leader == Rest("leader")
    assert follower.words() == (
        "follower was told to stand and still turns at 0.30 rad/s, by the last that was heard of its odometry"
    )


def test_of_many_robots_only_those_that_do_not_stand_are_named() -> None:
    many = [Rest(f"r{k}", Motion(0.001 * k, 0.0), 0.1) for k in range(6)]
    assert rest_words([*many, Rest("a", Motion(0.2, 0.0)), Rest("b")]) == (
        "6 of 8 stand (odometry at most 0.005 m/s, 0.00 rad/s after at most 0.1 s), "
        "a was told to stand and still moves at 0.20 m/s, b: nothing heard of its odometry: look at the robot"
    )
    assert rest_words([]) == ""
