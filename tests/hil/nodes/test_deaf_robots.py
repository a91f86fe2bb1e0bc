"""For how long a robot that does not listen holds a start up."""

from __future__ import annotations

import pytest

from hil.nodes.deaf_robots import PATIENCE_S, DeafRobots, waits_for, with_report
from hil.nodes.node import diagnostics

NOBODY: DeafRobots = {}
S = 1_000_000_000
DEAF = {"finding.deaf_robot": "nobody listens to /follower/cmd_vel, expected its robot to"}
WORDS = "waiting for a robot to listen, of which bridge/ros2 tells"


def told(deaf: DeafRobots, at_s: float, name: str = "bridge/ros2", *, listens: bool = False) -> DeafRobots:
    return with_report(deaf, diagnostics(name, 1, "", {} if listens else DEAF), round(at_s * S))


def test_it_is_held_up_until_the_robot_listens() -> None:
    deaf = told(NOBODY, 1.0)
    assert waits_for(deaf, 2 * S) == WORDS
    assert waits_for(told(deaf, 2.0, listens=True), 2 * S) == ""


def test_who_has_fallen_silent_holds_nobody_up() -> None:
    deaf = told(NOBODY, 1.0)
    assert waits_for(deaf, round(3.9 * S)) == WORDS
    assert waits_for(deaf, round(4.1 * S)) == ""


@pytest.mark.parametrize("back_s", [0.0, 3600.0])
def test_it_is_not_held_up_for_ever(back_s: float) -> None:
    deaf, begun_s = told(NOBODY, 7200.0), 7200.0 - back_s
    for half_second in range(round(2.0 * PATIENCE_S) + 1):
        at_s = begun_s + 0.5 * half_second
        deaf = told(deaf, at_s)
        assert (waits_for(deaf, round(at_s * S)) != "") == (at_s - begun_s < PATIENCE_S)


def test_a_controller_whose_robot_stands_and_thousands_of_names_hold_nobody_up_for_long() -> None:
    assert told(NOBODY, 1.0, "controller/follower") == NOBODY
    deaf = NOBODY
    for number in range(1000):
        deaf = told(deaf, 1.0, f"bridge/{number}")
    assert len(deaf) < 100
