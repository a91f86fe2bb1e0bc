"""Logs that went through other tools, as a user has them: converted, cut, filtered, written anew."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.writer import Writer

from hil.command_line import main
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.messages import decode_as, encode
from hil.wire.topics import DIAGNOSTICS, LOG, RIGID_BODIES, TRUTH

Caught = pytest.CaptureFixture[str]
SECOND_NS = 1_000_000_000


@pytest.fixture(scope="module")
def run_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    settings = ["run.duration_s=7", "run.evaluate_from_s=1.5", "mocap.loss=0.05", "mocap.jitter_s=0.02"]
    run_lockstep(load_scenario("turtlebot3", settings), path)
    return path


def payload(channel: Channel, message: Message) -> bytes:
    return bytes(message.data)


def copied(
    source: Path,
    target: Path,
    *gone: str,
    first_ns: int = 0,
    end_ns: int = 2**63,
    change: Callable[[Channel, Message], bytes] = payload,
) -> Path:
    """What the ``mcap`` package's own writer makes of messages: no metadata, one of the times."""
    with source.open("rb") as stream, target.open("wb") as made:
        writer = Writer(made)
        writer.start(profile="ros2", library="another")
        known: dict[int, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages(
            starting_at=first_ns, ending_before=end_ns
        ):
            assert schema is not None
            if channel.topic in gone:
                continue
            if channel.id not in known:
                kept = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, "cdr", kept)
            data = change(channel, message)
            writer.add_message(known[channel.id], message.log_time, data, message.log_time)
        writer.finish()  # type: ignore[no-untyped-call]  # the package leaves it unannotated
    return target


def replayed(log: Path, caught: Caught, *options: str) -> tuple[int, str, dict[str, Any]]:
    """Exit code, what was said, and the summary."""
    caught.readouterr()
    with pytest.raises(SystemExit) as left:
        main(["replay", str(log), "--json", *options])
    said = caught.readouterr()
    assert isinstance(left.value.code, int)
    return left.value.code, said.err, json.loads(said.out) if said.out else {}


def converted(source: Path, target: Path, *options: str) -> None:
    command = Path(sys.executable).with_name("rosbags-convert")
    subprocess.run([command, "--src", source, "--dst", target, *options], check=True, capture_output=True)


def test_no_chunk_of_a_run_holds_more_than_a_fifth_of_a_second(run_log: Path) -> None:
    with run_log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    spans = [chunk.message_end_time - chunk.message_start_time for chunk in summary.chunk_indexes]
    assert SECOND_NS / 10 < max(spans) < SECOND_NS / 5


def test_a_log_verifies_that_was_a_database_in_between(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    """It has lost its metadata, and of the times of logging and of sending one."""
    converted(run_log, tmp_path / "between")
    assert (tmp_path / "between" / "between.db3").exists()
    converted(tmp_path / "between", tmp_path / "back", "--dst-storage", "mcap")
    back = tmp_path / "back" / "back.mcap"
    code, _, summary = replayed(back, capsys, "--verify")
    assert code == 0
    assert summary["parity"]["estimates"]["compared"] > 800
    assert "fed" not in summary
    whole = replayed(run_log, capsys, "--verify")[2]
    assert {**summary, "log": {}} == {**whole, "log": {}}


def test_a_log_verifies_that_another_writer_filtered(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    less = copied(run_log, tmp_path / "less.mcap", TRUTH, DIAGNOSTICS, "leader/odom", "leader/cmd_vel")
    code, _, summary = replayed(less, capsys, "--verify")
    assert (code, summary["parity"]["commands"]["mismatched"]) == (0, 0)
    converted(run_log, tmp_path / "by_type", "--dst-storage", "mcap", "--exclude-topic", TRUTH)
    assert replayed(tmp_path / "by_type" / "by_type.mcap", capsys, "--verify")[0] == 0


def test_a_log_verifies_up_to_where_it_was_cut_off(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    start_ns = read_log(run_log).start_ns
    assert start_ns is not None
    code, _, summary = replayed(
        copied(run_log, tmp_path / "cut.mcap", end_ns=start_ns + 3 * SECOND_NS), capsys, "--verify"
    )
    assert (code, summary["parity"]["estimates"]["mismatched"]) == (0, 0)


def test_a_log_that_lacks_its_beginning_says_so(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    start_ns = read_log(run_log).start_ns
    assert start_ns is not None
    late = copied(run_log, tmp_path / "late.mcap", first_ns=start_ns + 2 * SECOND_NS)
    code, said, summary = replayed(late, capsys, "--verify")
    assert code == 1
    assert summary["parity"]["estimates"]["mismatched"]
    assert "its first 2.0 s were cut off, and nobody can repeat what rests on them" in said


def test_a_log_that_lacks_even_the_description_is_fed(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    bare = copied(run_log, tmp_path / "bare.mcap", LOG)
    code, said, summary = replayed(bare, capsys)
    assert code == 0
    assert f"log {bare}: its inputs are fed in log order: it does not say by which scenario" in said
    assert str(summary["fed"]["why"]) in said
    assert summary["estimation"]["rmse"]
    code, said, summary = replayed(bare, capsys, "--verify")
    assert code == 1
    assert f"log {bare}: nothing to verify: it does not say by which scenario" in said


def test_a_log_with_edited_inputs_is_fed(run_log: Path, capsys: Caught, tmp_path: Path) -> None:
    def moved(channel: Channel, message: Message) -> bytes:
        if channel.topic != RIGID_BODIES:
            return payload(channel, message)
        frame = decode_as(message.data, msg.RigidBodies)
        for body in frame.rigidbodies:
            body.pose.position.x += 1.0
        return encode(frame)

    edited = copied(run_log, tmp_path / "edited.mcap", change=moved)
    code, said, summary = replayed(edited, capsys)
    assert code == 0
    assert str(summary["fed"]["why"]).endswith("have others in their place")
    assert str(summary["fed"]["why"]) in said
    assert summary["estimation"]["rmse"]
    code, said, _ = replayed(edited, capsys, "--verify")
    assert code == 1
    assert "nothing to verify" in said
