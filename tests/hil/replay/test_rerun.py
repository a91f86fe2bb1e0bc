from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil import __version__
from hil.errors import UsageError
from hil.judge.replay_verdict import why_not_same
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.metadata import log_metadata, scenario_of
from hil.log.reader import Log, Record, read_log
from hil.log.writer import LogWriter
from hil.replay.re_execution import Parity
from hil.replay.rerun import Replay, replay
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario, with_overrides
from hil.wire import topics
from hil.wire.message_types import Malformed
from hil.wire.messages import encode, header, typename_of

SHORT = ("run.duration_s=2.5", "run.seed=7")
ROUGH = ("mocap.loss=0.05", "mocap.jitter_s=0.02")
Change = Callable[[Record], Record | None]


@pytest.fixture(scope="module")
def rough_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return lockstep_log(tmp_path_factory.mktemp("rough"), *ROUGH)


def lockstep_log(folder: Path, *overrides: str) -> Log:
    run_lockstep(load_scenario("turtlebot3", [*SHORT, *overrides]), folder / "run.mcap")
    return read_log(folder / "run.mcap")


def rewritten(log: Log, path: Path, change: Change) -> Log:
    """The log with each record changed, or left out where the change gives None."""
    with LogWriter(path, log.metadata) as out:
        for record in log.records():
            kept = change(record)
            if kept is not None:
                out.write(kept.topic, kept.typename, kept.payload, kept.log_ns, kept.publish_ns)
    return read_log(path)


def nth(topic: str, number: int, change: Change) -> Change:
    """Change the record of the given number on a topic, and nothing else."""

    def only(record: Record) -> Record | None:
        return change(record) if (record.topic, record.sequence) == (topic, number) else record

    return only


def flipped(byte: int) -> Change:
    def flip(record: Record) -> Record:
        payload = bytearray(record.payload)
        payload[byte] ^= 1
        return Record(
            record.topic, record.typename, bytes(payload), record.log_ns, record.publish_ns, record.sequence
        )

    return flip


def mismatches(played: Replay) -> tuple[int, int]:
    return played.parity["estimates"].mismatched, played.parity["commands"].mismatched


@pytest.mark.parametrize(
    "overrides",
    [
        ROUGH,
        (*ROUGH, "estimator.kind=ukf"),
        (*ROUGH, "estimator.kind=difference"),
        ("estimator.front_end=body", "controller.command_type=Twist"),
        # Most frames lost: the estimator coasts and speaks at ticks, the controller stops.
        ("mocap.loss=0.97",),
    ],
    ids=["rough", "ukf", "difference", "body", "coasting"],
)
def test_every_estimate_and_command_of_a_log_comes_out_again(
    overrides: tuple[str, ...], tmp_path: Path
) -> None:
    log = lockstep_log(tmp_path, *overrides)
    played = replay(log)
    assert mismatches(played) == (0, 0)
    assert played.missing_inputs == 0
    names = {"estimates": "follower/leader_estimate", "commands": "follower/command"}
    for name, topic in names.items():
        assert played.parity[name].compared == sum(1 for _ in log.records([topic])) > 20
    assert len(played.estimates) == played.parity["estimates"].compared
    assert len(played.commands) == played.parity["commands"].compared


@pytest.mark.parametrize(
    ("topic", "byte", "expected"),
    [
        # Of an estimate the bit is in rho; the controller's command rests on it, so its receipt fails too.
        ("follower/leader_estimate", 44, (1, 1)),
        ("follower/command", 44, (0, 1)),
        ("follower/cmd_vel", -48, (0, 1)),
    ],
)
def test_a_flipped_bit_is_found(
    topic: str, byte: int, expected: tuple[int, int], rough_log: Log, tmp_path: Path
) -> None:
    bad = rewritten(rough_log, tmp_path / "bad.mcap", nth(topic, 100, flipped(byte)))
    played = replay(bad)
    found = mismatches(played)
    assert found[0] == expected[0]
    assert found[1] >= expected[1]
    assert played.parity["estimates" if expected[0] else "commands"].first is not None


@pytest.fixture(scope="module")
def certified_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return lockstep_log(tmp_path_factory.mktemp("certified"), *ROUGH, CERTIFY)


def test_certified_estimates_come_out_again_bit_for_bit(certified_log: Log, tmp_path: Path) -> None:
    topic = "follower/certified"
    played = replay(certified_log)
    logged = sum(1 for _ in certified_log.records([topic]))
    assert played.parity["certified"] == Parity(logged, 0)
    assert logged == played.parity["estimates"].compared == len(played.certified) > 100
    bad = rewritten(certified_log, tmp_path / "bad.mcap", nth(topic, 100, flipped(44)))
    found = replay(bad).parity
    assert (found["certified"].mismatched, found["certified"].first) == (1, 100)
    assert found["estimates"].mismatched == found["commands"].mismatched == 0
    missing = rewritten(certified_log, tmp_path / "missing.mcap", nth(topic, 100, lambda record: None))
    assert replay(missing).parity["certified"] == Parity(logged - 1, 0, None, 1)


def test_a_log_is_verified_with_and_without_certified_estimates(certified_log: Log, rough_log: Log) -> None:
    """They stand beside the rest: asked for afterwards, or no longer, all else is the same."""
    for log, asked in ((rough_log, "true"), (certified_log, "false")):
        own = scenario_of(log)
        assert own is not None
        played = replay(log, with_overrides(own, [f"estimator.certify={asked}"]))
        assert mismatches(played) == (0, 0)
        assert "certified" not in played.parity
        assert bool(played.certified) == (asked == "true")


@pytest.mark.parametrize("topic", ["follower/leader_estimate", "follower/command"])
def test_an_output_that_no_longer_decodes_is_a_mismatch(topic: str, rough_log: Log, tmp_path: Path) -> None:
    def cut(record: Record) -> Record:
        return Record(record.topic, record.typename, b"\0\1\0\0", record.log_ns, record.publish_ns, 0)

    assert replay(rewritten(rough_log, tmp_path / "bad.mcap", nth(topic, 50, cut))).mismatched > 0


def test_a_frame_that_the_recorder_missed_is_a_mismatch_and_no_crash(rough_log: Log, tmp_path: Path) -> None:
    bad = rewritten(rough_log, tmp_path / "bad.mcap", nth(topics.RIGID_BODIES, 120, lambda record: None))
    played = replay(bad)
    assert played.missing_inputs == 1
    assert played.parity["estimates"].mismatched > 0


def test_what_could_not_be_decoded_is_part_of_the_replay(rough_log: Log, tmp_path: Path) -> None:
    """A consumed payload that was kept as malformed has the receipt of the topic it came in on."""

    def keep_as_malformed(record: Record) -> Record:
        if record.topic != topics.RIGID_BODIES:
            return record
        kept = Malformed(
            header(record.log_ns, ""), record.topic, np.frombuffer(record.payload, dtype=np.uint8)
        )
        return Record(topics.MALFORMED, typename_of(kept), encode(kept), record.log_ns, record.publish_ns, 0)

    assert replay(rewritten(rough_log, tmp_path / "m.mcap", keep_as_malformed)).mismatched == 0


def test_another_estimator_gives_other_estimates_of_the_same_captures(rough_log: Log) -> None:
    scenario = scenario_of(rough_log)
    assert scenario is not None
    same, other = replay(rough_log), replay(rough_log, with_overrides(scenario, ["estimator.kind=ukf"]))
    assert other.commands == ()
    assert not other.parity
    assert [each.header.stamp for each in other.estimates] == [each.header.stamp for each in same.estimates]
    gap = [abs(a.v1 - b.v1) for a, b in zip(other.estimates, same.estimates, strict=True)][-100:]
    assert 0.0 < max(gap) < 0.002


def test_a_log_without_estimates_gives_them_from_the_inputs_alone(rough_log: Log, tmp_path: Path) -> None:
    """Fed in log order, as these inputs were, the estimates come out as they did live."""

    def inputs_only(record: Record) -> Record | None:
        return record if record.topic in (topics.RIGID_BODIES, "follower/odom") else None

    fed = replay(rewritten(rough_log, tmp_path / "inputs.mcap", inputs_only))
    live = replay(rough_log)
    assert [each.v1 for each in fed.estimates] == [each.v1 for each in live.estimates]
    assert fed.commands == ()
    assert not fed.parity


def test_the_pair_may_change_roles(rough_log: Log) -> None:
    """The leader's own odometry is in the log, so that it can be asked what it would see of its follower."""
    scenario = scenario_of(rough_log)
    assert scenario is not None
    played = replay(rough_log, with_overrides(scenario, ["leader.name=follower", "follower.name=leader"]))
    assert len(played.estimates) > 200
    assert all(abs(each.v1) < 0.3 for each in played.estimates)


def without(*gone: str) -> Change:
    outputs = ("follower/leader_estimate", "follower/command")
    return lambda record: None if record.topic in (*gone, *outputs) else record


@pytest.mark.parametrize(
    ("change", "overrides", "said"),
    [
        (without(topics.RIGID_BODIES), (), "has no measurement of the leader, expected topic 'rigid_bodies'"),
        (
            without("follower/odom"),
            ("estimator.own_motion=odometry",),
            "has no odometry of follower 'follower'",
        ),
        (without(), ("follower.name=burger",), "follower 'burger' is not among .* one of: follower, leader"),
        (without(), ("leader.name=burger",), "leader 'burger' is not among .* one of: follower, leader"),
    ],
)
def test_a_log_that_lacks_something_is_refused_by_name(
    change: Change, overrides: tuple[str, ...], said: str, rough_log: Log, tmp_path: Path
) -> None:
    log = rewritten(rough_log, tmp_path / "less.mcap", change)
    scenario = scenario_of(log)
    assert scenario is not None
    with pytest.raises(UsageError, match=said):
        replay(log, with_overrides(scenario, overrides))


@pytest.mark.parametrize("source", ["auto", "mocap"])
def test_a_log_without_odometry_is_replayed_by_the_poses_alone(
    source: str, rough_log: Log, tmp_path: Path
) -> None:
    log = rewritten(rough_log, tmp_path / "poses.mcap", without("follower/odom"))
    scenario = scenario_of(log)
    assert scenario is not None
    played = replay(log, with_overrides(scenario, [f"estimator.own_motion={source}"]))
    assert len(played.estimates) > 200
    assert all(abs(each.v1) < 0.3 for each in played.estimates)


def test_sightings_without_the_body_front_end_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.mcap"
    with LogWriter(path, log_metadata(load_scenario("turtlebot3"), "import")) as log:
        log.write("follower/leader_sighting", "abreast_msgs/msg/RangeBearing", b"", EPOCH_NS, EPOCH_NS)
    with pytest.raises(UsageError, match=r"expected estimator\.front_end = 'body'"):
        replay(read_log(path))


def test_a_log_of_another_make_is_sent_for_a_map(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "other.mcap", {}) as log:
        log.write("odom", "nav_msgs/msg/Odometry", b"", EPOCH_NS, EPOCH_NS)
    with pytest.raises(UsageError, match=r"name its topics with --map FILE \(topics there: odom\)"):
        replay(read_log(tmp_path / "other.mcap"))


def test_a_gap_in_the_log_is_told_where_it_is_why_outputs_differ(rough_log: Log, tmp_path: Path) -> None:
    assert rough_log.end_ns is not None
    middle_ns = rough_log.end_ns - 3 * 10**9

    def cut(record: Record) -> Record | None:
        return None if 0 <= record.log_ns - middle_ns < 10**9 else record

    log = rewritten(rough_log, tmp_path / "gap.mcap", cut)
    assert "the log has nothing of 1.0 s before" in why_not_same(log, replay(log))


def test_the_version_that_wrote_a_log_is_told_only_where_outputs_differ(
    rough_log: Log, tmp_path: Path
) -> None:
    own = rough_log.metadata["abreast"]
    older = replace(rough_log, metadata={**rough_log.metadata, "abreast": {**own, "version": "0.0.9"}})
    kept = rewritten(older, tmp_path / "kept.mcap", lambda record: record)
    assert why_not_same(kept, replay(kept)) == ""
    older_says = f"it was written by abreast 0.0.9 and this is {__version__}"
    for number, (log, topic, reasons) in enumerate(
        [
            (older, "follower/cmd_vel", [older_says]),
            (older, "follower/leader_estimate", ["1 inputs are missing in the log", older_says]),
            (rough_log, "follower/cmd_vel", ["and with this version of abreast?"]),
        ]
    ):
        damaged = rewritten(log, tmp_path / f"{number}.mcap", nth(topic, 20, flipped(-48)))
        said = why_not_same(damaged, replay(damaged))
        assert all(reason in said for reason in reasons)
        assert (older_says in said) == (log is older)
