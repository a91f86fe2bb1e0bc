"""What a bridge says of what it sees: in diagnostics twice a second, and on its console when it changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.bridge.mocap_wire import MocapWire
from hil.bridge.seen_frame import SeenBody, SeenFrame, Up
from hil.errors import UsageError
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire.message_types import DiagnosticArray, RigidBodies
from hil.wire.messages import decode_as
from hil.wire.pose_sources import laid
from hil.wire.records import Placement
from hil.wire.source_topics import all_bodies

MS = 1_000_000
S = 1_000_000_000
T0 = 1_700_000_000 * S
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Lab:
    """A wire that is fed, and what it says."""

    def __init__(self, *overrides: str, up: Up | None = None) -> None:
        self.said: list[str] = []
        self.wire = MocapWire("bridge/lab", load_scenario("turtlebot3", overrides), up, self.said.append)
        self.now, self.number = T0, 0

    def see(self, *bodies: SeenBody, delay_ns: int = 8 * MS) -> RigidBodies:
        self.now += 10 * MS
        self.number += 1
        frame = SeenFrame(self.number, self.now - delay_ns, self.now, bodies)
        return decode_as(self.wire.publish(frame).payload, RigidBodies)

    def report(self, waiting: str = "") -> list[Outgoing]:
        return list(self.wire.report(self.now, waiting, {"frames": self.number}))

    def problem(self) -> tuple[str, dict[str, str]]:
        (status,) = decode_as(self.wire.last_report(self.now, "", {}).payload, DiagnosticArray).status
        return status.message, {entry.key: entry.value for entry in status.values}


def body(name: str, number: str = "9", *, tracked: bool = True, x: float = 0.0, y: float = 0.0) -> SeenBody:
    return SeenBody(name, number, (x, y, 0.1), UPRIGHT, tracked)


def test_all_robots_of_a_chain_are_wanted_by_what_the_motion_capture_calls_them() -> None:
    chain = load_scenario("chain5-turtlebot3", ['leader.body="1"', 'chain.bodies=["c","d","e"]'])
    assert all_bodies(chain) == ("1", chain.follower.name, "c", "d", "e")


def test_it_reports_twice_a_second_and_says_what_has_changed() -> None:
    lab = Lab()
    reports = []
    for k in range(200):
        if k < 100:
            lab.see(body("leader"), body("follower", tracked=k >= 50))
        else:
            lab.now += 10 * MS
        reports += lab.report()
    assert len(reports) == 4
    assert lab.said == [
        "waiting for 'follower', which the motion capture does not see",
        "sees 'leader', 'follower'",
        "waiting for frames",
    ]


def test_bodies_of_other_names_are_named() -> None:
    lab = Lab('leader.body="7"')
    lab.see(body("Robot A", "7"), body("Robot B", "8"))
    problem, values = lab.problem()
    assert problem == "waiting for 'follower'; in its frames are 'Robot B'"
    assert values["finding.bodies"] == "wanted 'follower', in the frames are '7', 'Robot B'"
    assert lab.said == [problem]


def test_delays_and_what_was_dropped_are_told() -> None:
    lab = Lab()
    for delay in (5, 6, 9):
        lab.see(body("leader"), body("follower"), delay_ns=delay * MS)
    lab.see(body("leader", tracked=False), SeenBody("follower", "", (float("nan"), 0.0, 0.0), UPRIGHT))
    _, values = lab.problem()
    assert (values["delay_ms"], values["delay_spread_ms"]) == ("7.000", "4.000")
    assert (values["bodies.untracked"], values["bodies.not_finite"]) == ("1", "1")
    assert values["bodies.seen"] == "leader, follower"


@pytest.mark.parametrize(
    ("given", "scenario", "expected"),
    [
        (None, "z", (1.0, 2.0, 3.0)),
        (None, "y", (1.0, 2.0, 3.0)),
        ("y", "z", (1.0, -3.0, 2.0)),
        ("z", "y", (1.0, 3.0, -2.0)),
        ("y", "y", (1.0, 2.0, 3.0)),
    ],
)
def test_messages_have_the_axes_that_the_scenario_takes_them_to_have(
    given: Up | None, scenario: str, expected: tuple[float, float, float]
) -> None:
    lab = Lab(f'source.up="{scenario}"', up=given)
    (told,) = lab.see(SeenBody("leader", "1", (1.0, 2.0, 3.0), UPRIGHT)).rigidbodies
    at = told.pose.position
    assert (at.x, at.y, at.z) == expected


@pytest.mark.parametrize(
    ("changes", "topic"), [((), "rigid_bodies"), (("source.up=y",), "source/rigid_bodies")]
)
def test_frames_go_where_the_scenario_hears_its_source(changes: tuple[str, ...], topic: str) -> None:
    frame = SeenFrame(1, T0, T0, (SeenBody("leader", "1", (1.0, 2.0, 3.0), UPRIGHT),))
    assert Lab(*changes).wire.publish(frame).topic == topic


@pytest.mark.parametrize(("streamed", "told"), [("y", "z"), ("z", "y"), ("z", "z"), ("y", "y")])
def test_a_wrong_axis_is_found_along_the_track_and_named_once(streamed: Up, told: Up) -> None:
    lab = Lab(up=told)
    for angle in np.linspace(0.0, 12.0, 800).tolist():
        ground = Placement(0.3 * math.cos(angle), 0.3 * math.sin(angle), 0.1, *UPRIGHT)
        place = laid(ground, streamed, 1.0)
        lab.see(SeenBody("leader", "1", place[:3], place[3:]), body("follower"))
        lab.report()
    problem, values = lab.problem()
    if streamed == told:
        assert (problem, "finding.axes" in values) == ("ok", False)
        return
    assert values["finding.axes"].startswith(
        f"by {told} up, as told, y is up: the leader's z varies by 0.6 m"
    )
    assert problem == "axes"
    assert sum("axes" in line for line in lab.said) == 1


def test_other_messages_are_none_that_it_publishes() -> None:
    with pytest.raises(UsageError, match="RigidBodies"):
        Lab('source.type="PoseStamped"')


def test_what_keeps_frames_from_coming_goes_before_all_else() -> None:
    lab = Lab()
    (report,) = lab.report("waiting for the model")
    (status,) = decode_as(report.payload, DiagnosticArray).status
    assert (status.level, status.message) == (1, "waiting for the model")
    assert lab.said == ["waiting for the model"]
