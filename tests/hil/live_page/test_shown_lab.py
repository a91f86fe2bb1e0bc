from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion, Pose
from formation.shape import shape_of
from hil.live_page.orbit import orbit_of
from hil.live_page.shown_lab import ShownLab
from hil.nodes.node import diagnostics
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.wire.events import Event, Origin
from hil.wire.messages import encode
from tests.hil.live_page.lab_words import NS, command, estimate, lab_words

SCENARIO = with_guards(load_scenario("changing-sides"))
LEADER, FOLLOWER = Pose(1.0, 2.0, 0.3), Pose(1.2, 1.5, 0.4)
SHAPE = shape_of(LEADER, FOLLOWER)
NUMBERS = [SHAPE.rho, SHAPE.alpha1, SHAPE.alpha2, 0.5, 0.1, 0.02, 0.3, 1e-4]

ANY = st.floats(allow_nan=True, allow_infinity=True)


def strict(value: object) -> Any:
    """A value after its way to a browser, which knows no NaN."""
    return json.loads(json.dumps(value, allow_nan=False))


def shown(lab: ShownLab, now: float = 10.0) -> tuple[Any, Any]:
    return strict(lab.motion(0, now)), strict(lab.reports(now))


def hear(lab: ShownLab, now: float = 10.0, text: str = "") -> None:
    for topic, payload in lab_words(LEADER, FOLLOWER, Motion(0.2, -0.1), NUMBERS, text):
        lab.hear(Event(topic, payload, Origin("7f", 1, 1)), now)


def test_a_lab_that_says_nothing_is_shown_as_one_of_which_nothing_is_known() -> None:
    motion, reports = shown(ShownLab(SCENARIO))
    assert (motion["estimate"], motion["command"]) == (None, None)
    assert [robot["pose"] for robot in motion["robots"]] == [None, None]
    assert reports["missing_bodies"] == ["leader", "follower"]
    assert (reports["nodes"], reports["stop"]) == ([], None)


def test_what_was_heard_is_shown_with_its_age() -> None:
    lab = ShownLab(SCENARIO)
    hear(lab, text="because")
    motion, reports = shown(lab, 10.5)
    leader, follower = motion["robots"]
    assert leader["pose"] == pytest.approx([*LEADER])
    assert (follower["told"], follower["own"], follower["stands"]) == ([0.2, -0.1], [0.2, -0.1], False)
    assert {leader["pose_age"], follower["told_age"], follower["own_age"]} == {0.5}
    seen, sent = motion["estimate"], motion["command"]
    assert (seen["status"], seen["reason"], seen["age"]) == ("tracking", "because", 0.5)
    assert seen["v1"] == [0.5, 0.01, 0.02]
    assert seen["leader"]["pose"] == pytest.approx([*LEADER], abs=1e-5)
    assert (sent["sent"], sent["measurement_age"], sent["stop"]) == ([0.2, -0.1], 0.031, "because")
    assert motion["station"] == pytest.approx([0.5, math.pi / 2, -math.pi / 2], abs=1e-5), "on the left"
    (estimator,) = (node for node in reports["nodes"] if node["name"] == "estimator")
    assert (estimator["refused"], estimator["age_s"]) == ({"tilted": 7}, 0.5)
    assert [each["name"] for each in estimator["findings"]] == ["axes"]
    assert (reports["guards"], reports["missing_bodies"]) == ({"follower": ""}, [])
    assert (reports["stop"]["reason"], reports["stop"]["by"]) == ("because", "session 7f")
    assert reports["side"] == {"side": "left", "change": "under way"}


POSE = st.builds(Pose, ANY, ANY, st.floats(allow_infinity=False))


@given(
    st.tuples(POSE, POSE) | st.just((LEADER, FOLLOWER)),
    st.builds(Motion, ANY, ANY),
    st.lists(ANY, min_size=8, max_size=32),
    st.text(max_size=400),
)
def test_whatever_is_said_what_is_shown_is_json(
    poses: tuple[Pose, Pose], moves: Motion, numbers: list[float], text: str
) -> None:
    lab = ShownLab(SCENARIO)
    for topic, payload in lab_words(*poses, moves, numbers, text.replace("\0", "")):
        lab.hear(Event(topic, payload), 1.0)
    motion, reports = shown(lab)
    assert (motion["estimate"]["v1"][0] is not None) == math.isfinite(numbers[3])
    assert len(json.dumps(reports)) < 50_000


@given(st.binary(max_size=200), st.integers(0, 100))
def test_junk_on_any_topic_disturbs_nothing_else(junk: bytes, place: int) -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    topic = list(lab.kept)[place % len(lab.kept)]
    lab.hear(Event(topic, junk), 10.0)
    motion, _ = shown(lab)
    poses = [robot["pose"] for robot in motion["robots"]]
    assert poses == [pytest.approx([*LEADER]), pytest.approx([*FOLLOWER])]


def test_a_body_without_a_heading_is_a_place_and_one_that_is_no_number_is_where_it_was() -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    for topic, payload in lab_words(Pose(math.nan, 0.0, 0.0), FOLLOWER, Motion(0.0, 0.0), NUMBERS):
        lab.hear(Event(topic, payload), 11.0)
    motion, _ = shown(lab, 11.0)
    leader, follower = motion["robots"]
    assert (leader["pose_age"], follower["pose_age"]) == (1.0, 0.0)
    assert (leader["stands"], follower["stands"]) == (True, True)


def test_the_orbit_is_shown_from_when_the_leader_set_off() -> None:
    lab = ShownLab(SCENARIO)
    orbit = lab.orbit = orbit_of(SCENARIO)
    assert orbit is not None
    lab.hear(Event("follower/leader_estimate", encode(estimate(NUMBERS, stamp_ns=9 * NS))), 1.0)
    assert shown(lab)[0]["estimate"]["orbit"] is None
    report = diagnostics("emulator", 10 * NS, "", {"motion_since_ns": 7 * NS})
    lab.hear(Event("diagnostics", encode(report)), 1.0)
    assert shown(lab)[0]["estimate"]["orbit"] == pytest.approx(orbit.at(2.0), rel=1e-5)


def test_the_orbit_is_not_shown_any_more_once_somebody_else_sent_the_follower_to_a_side() -> None:
    lab = ShownLab(SCENARIO)
    lab.orbit = orbit_of(SCENARIO)

    def orbit_at(since_s: float, side: str) -> object:
        started = diagnostics("emulator", 10 * NS, "", {"motion_since_ns": 7 * NS})
        lab.hear(Event("diagnostics", encode(started)), 1.0)
        lab.hear(Event("diagnostics", encode(diagnostics("controller", 5, "", {"side": side}))), 1.0)
        seen = estimate(NUMBERS, stamp_ns=7 * NS + round(since_s * NS))
        lab.hear(Event("follower/leader_estimate", encode(seen)), 1.0)
        return shown(lab)[0]["estimate"]["orbit"]

    for since_s, side in ((7.0, "right"), (8.5, "right"), (8.5, "left"), (29.0, "left"), (31.0, "right")):
        assert orbit_at(since_s, side), (since_s, side)
    assert orbit_at(33.0, "left") or orbit_at(33.0, "right"), "one of both is on its way"
    assert orbit_at(36.0, "right") is None
    assert orbit_at(36.5, "left") is None


def test_a_thousand_nodes_of_long_words_make_no_long_frame() -> None:
    lab = ShownLab(SCENARIO)
    for k in range(1000):
        refused = {f"refused.{j}{'x' * 900}": j for j in range(40)}
        values = refused | {f"finding.{j}": "y" * 900 for j in range(40)}
        lab.hear(Event("diagnostics", encode(diagnostics(f"n{k}" + "z" * 900, 5, "w" * 900, values))), 1.0)
    _, reports = shown(lab)
    assert (len(reports["nodes"]), reports["more_nodes"]) == (60, 940)
    assert len(json.dumps(reports)) < 300_000


def test_what_was_heard_before_nobody_looked_is_forgotten() -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    lab.forget()
    assert shown(lab) == shown(ShownLab(SCENARIO))


def test_an_old_decision_of_no_measurement_has_no_age_of_one() -> None:
    lab = ShownLab(SCENARIO)
    sent = command(0.0, 0.0)
    sent.measured.sec = 0
    lab.hear(Event("follower/command", encode(sent)), 1.0)
    assert shown(lab)[0]["command"]["measurement_age"] is None


def test_a_guard_that_is_silent_is_not_shown_as_one_that_lets_its_robot_drive() -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    stranger = diagnostics("guard/stranger", 5, "", {"latched": ""})
    lab.hear(Event("diagnostics", encode(stranger)), 13.0)
    assert shown(lab, 13.0)[1]["guards"] == {"follower": ""}
    assert shown(lab, 13.1)[1]["guards"] == {}


def test_what_was_seen_too_long_ago_places_no_believed_leader_and_is_missing() -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    lab.hear(Event("follower/leader_estimate", encode(estimate(NUMBERS))), 11.2)
    motion, reports = shown(lab, 11.2)
    assert (motion["estimate"]["age"], motion["estimate"]["leader"]) == (0.0, None)
    assert reports["missing_bodies"] == ["leader", "follower"]
    for topic, payload in lab_words(LEADER, FOLLOWER, Motion(0.2, -0.1), NUMBERS):
        if topic == "rigid_bodies":
            lab.hear(Event(topic, payload), 11.2)
    motion, reports = shown(lab, 11.2)
    assert motion["estimate"]["leader"] is not None
    assert reports["missing_bodies"] == []


@pytest.mark.parametrize(("topic", "kind"), [("cmd_vel", "told"), ("odom", "own")])
def test_what_cannot_be_read_is_not_shown_as_what_was_said_before(topic: str, kind: str) -> None:
    lab = ShownLab(SCENARIO)
    hear(lab)
    lab.hear(Event(f"follower/{topic}", b"junk"), 20.0)
    _, follower = shown(lab, 20.0)[0]["robots"]
    assert (follower[kind], follower[f"{kind}_age"]) == (None, 0.0)


def test_a_side_that_is_none_is_left() -> None:
    lab = ShownLab(SCENARIO)
    for word in ("left", "x" * 5000):
        said = diagnostics("controller", 5, "", {"side": word, "side_change": "none"})
        lab.hear(Event("diagnostics", encode(said)), 1.0)
    assert shown(lab)[1]["side"] == {"side": "left", "change": "none"}
