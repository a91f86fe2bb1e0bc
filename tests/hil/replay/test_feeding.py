from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.errors import UsageError
from hil.judge.replay_verdict import why_not_same
from hil.lockstep.run import run_lockstep
from hil.log.metadata import scenario_of
from hil.log.reader import Log, Record, read_log
from hil.log.writer import LogWriter
from hil.replay.feeding import guessed_link, why_edited, why_guessed
from hil.replay.rerun import replay, replay_fed
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode, header, typename_of

MS = 1_000_000
RECEIPTS = [(number, number * 10 * MS) for number in range(1000)]


def put_for(places: range, late_ns: int = 0) -> list[tuple[int, int]]:
    """The inputs of the receipts, those at the places changed and logged so much later."""
    return [
        (-digest if place in places else digest, at_ns + (late_ns if place in places else 0))
        for place, (digest, at_ns) in enumerate(RECEIPTS)
    ]


def test_receipts_of_what_is_there_lead_to_it() -> None:
    assert why_edited([], []) == why_edited([], RECEIPTS) == why_edited(RECEIPTS, RECEIPTS) == ""


@given(st.sets(st.integers(0, 999)), st.sets(st.integers(0, 999)))
def test_inputs_that_nobody_logged_or_nobody_took_in_are_not_edited(
    unlogged: set[int], unread: set[int]
) -> None:
    """As long as these are not the same moments."""
    near = {place + step for place in unlogged for step in range(-10, 11)}
    if unread & near or len(unlogged) > 300:
        return
    consumed = [receipt for place, receipt in enumerate(RECEIPTS) if place not in unread]
    logged = [receipt for place, receipt in enumerate(RECEIPTS) if place not in unlogged]
    assert why_edited(consumed, logged) == ""


@pytest.mark.parametrize("late_ms", [-50, 0, 50])
@pytest.mark.parametrize("places", [range(1, 1000), range(300, 301), range(2, 900, 4)])
def test_an_input_in_the_place_of_another_is_an_edited_one(places: range, late_ms: int) -> None:
    said = why_edited(RECEIPTS, put_for(places, late_ms * MS))
    assert said == f"{len(places)} of the 1000 inputs that its estimates rest on have others in their place"


def test_all_inputs_may_have_been_edited_and_logged_at_another_time() -> None:
    said = why_edited(RECEIPTS, put_for(range(1, 1000), 3_600_000 * MS))
    assert said.startswith("999 of the 1000 inputs")
    assert why_edited(RECEIPTS, RECEIPTS[:200]) == ""


@pytest.fixture(scope="module")
def run_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    run_lockstep(
        load_scenario("turtlebot3", ["run.duration_s=2.5", "mocap.loss=0.05", "leader.name=waffle"]), path
    )
    return read_log(path)


def kept(log: Log, path: Path, *names: str, metadata: bool = False) -> Log:
    """A copy of some topics."""
    with LogWriter(path, log.metadata if metadata else {}) as out:
        for record in log.records(names):
            out.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    return read_log(path)


INPUTS = (topics.RIGID_BODIES, "follower/odom")


@pytest.mark.parametrize(
    "names", [INPUTS, (*INPUTS, "waffle/odom"), (*INPUTS, "waffle/odom", "follower/leader_estimate")]
)
def test_a_log_that_says_nothing_of_itself_is_fed(
    names: tuple[str, ...], run_log: Log, tmp_path: Path
) -> None:
    """Nobody need say who follows whom; the inputs were in log order, so all comes out as it did."""
    log = kept(run_log, tmp_path / "bare.mcap", *names)
    link = guessed_link(log, None, None)
    assert (link.leader, link.follower) == ("waffle", "follower")
    assert link.scenario.name == "turtlebot3"
    played = replay_fed(log, link, why_guessed(link))
    assert "does not say by which scenario" in why_not_same(log, played)
    assert not played.parity
    assert [each.v1 for each in played.estimates] == [each.v1 for each in replay(run_log).estimates]


def test_a_guessed_pair_may_be_named_and_its_scenario_changed(run_log: Log, tmp_path: Path) -> None:
    log = kept(run_log, tmp_path / "bare.mcap", *INPUTS, "waffle/odom")
    link = guessed_link(log, None, "waffle", ["leader.k_u=0.9"])
    assert (link.leader, link.follower, link.scenario.leader.k_u) == ("follower", "waffle", 0.9)
    assert guessed_link(log, "follower", None).follower == "waffle"
    with pytest.raises(UsageError, match="expected a pair"):
        guessed_link(log, None, None, ["chain.agents=3"])


@pytest.mark.parametrize(
    ("names", "why"),
    [
        (
            (topics.TRUTH,),
            "nor who follows whom; give --leader and --follower, or name its topics",
        ),
        (("follower/odom",), r"\(topics there: follower/odom\)"),
    ],
)
def test_a_log_that_does_not_tell_who_is_in_it_is_refused(
    names: tuple[str, ...], why: str, run_log: Log, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=why):
        guessed_link(kept(run_log, tmp_path / "bare.mcap", *names), None, None)


def test_a_sensor_on_the_follower_makes_a_log_of_sightings(tmp_path: Path) -> None:
    path = tmp_path / "bare.mcap"
    with LogWriter(path, {}) as out:
        for number in range(100):
            at_ns = 1_700_000_000_000_000_000 + number * 20 * MS
            odometry = odometry_message(at_ns, "burger", Pose(0.0, 0.0, 0.0), Motion(0.1, 0.0))
            out.write("burger/odom", typename_of(odometry), encode(odometry), at_ns, at_ns)
            seen = msg.RangeBearing(header(at_ns, "burger"), 0.2, 1.57)
            out.write("burger/leader_sighting", typename_of(seen), encode(seen), at_ns, at_ns)
    link = guessed_link(read_log(path), "waffle", None)
    assert (link.leader, link.follower, link.scenario.estimator.front_end) == ("waffle", "burger", "body")
    # Odometry that may slip by a tenth leaves v1 to 0.01 m/s, and no leader is faster than k_v = 0.1.
    assert replay_fed(read_log(path), link, "why").estimates[-1].v1 == pytest.approx(0.1, abs=1e-2)


def moved(record: Record) -> Record:
    """The frame with everything somewhere else in the room, by another origin of the motion capture."""
    if record.topic != topics.RIGID_BODIES:
        return record
    frame = decode_as(record.payload, msg.RigidBodies)
    for body in frame.rigidbodies:
        body.pose.position.x += 1.0
    return replace(record, payload=encode(frame))


def test_edited_inputs_are_fed_and_cannot_be_verified(run_log: Log, tmp_path: Path) -> None:
    path = tmp_path / "moved.mcap"
    with LogWriter(path, run_log.metadata) as out:
        for record in map(moved, run_log.records()):
            out.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    log = read_log(path)
    assert scenario_of(log) == scenario_of(run_log)
    played, was = replay(log), replay(run_log)
    assert (was.fed, why_not_same(run_log, was)) == ("", "")
    assert played.fed.endswith("have others in their place")
    assert played.fed in why_not_same(log, played)
    assert len(played.estimates) == len(was.estimates)
    assert max(abs(a.v1 - b.v1) for a, b in zip(played.estimates, was.estimates, strict=True)) < 1e-9
