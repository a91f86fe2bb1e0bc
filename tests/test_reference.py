"""Outputs are those of the reference logs; where they are meant to differ: `scripts/renew-reference`."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

import hil
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.wire import topics
from hil.wire.message_types import LeaderEstimate
from hil.wire.messages import decode_as, encode
from hil.wire.topics import topics_of
from tests import reference_logs
from tests.reference_logs import (
    FLIGHTS,
    FOLDER,
    WRITTEN_ON,
    flown_anew,
    hardware,
    path_of,
    renew,
    replayed,
    same_hardware,
    scenario_for,
    written_on,
)

LARGEST_BYTES = 160_000  # the writer says every second again what channels there are


def difference_report(name: str, lines: list[str]) -> str:
    """What to say of differences."""
    version = written_on()["abreast"]
    renewing = "if that is meant to be so, scripts/renew-reference keeps the new ones"
    return "\n".join([f"{name}, written by abreast {version}, gives other outputs; {renewing}", *lines])


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_nodes_make_the_same_of_recorded_inputs(name: str) -> None:
    lines = replayed(read_log(path_of(name)), exactly=same_hardware())
    assert not lines, difference_report(name, lines)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_same_flight_leaves_the_same_messages(name: str, tmp_path: Path) -> None:
    lines = flown_anew(read_log(path_of(name)), tmp_path, exactly=same_hardware())
    assert not lines, difference_report(name, lines)


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_reference_log_is_small_and_of_the_flight_that_its_name_stands_for(name: str) -> None:
    log = read_log(path_of(name))
    assert scenario_of(log) == scenario_for(name)
    assert path_of(name).stat().st_size < LARGEST_BYTES
    names = topics_of(scenario_for(name))
    assert {
        topics.RIGID_BODIES,
        topics.TRUTH,
        names.estimate,
        names.command,
        names.cmd_vel,
    } <= log.topics.keys()


def test_nothing_else_lies_beside_the_reference_logs() -> None:
    assert set(FOLDER.iterdir()) == {WRITTEN_ON, *map(path_of, FLIGHTS)}
    assert written_on().keys() == {"abreast", *hardware()}


def test_an_estimate_that_differs_is_told_with_its_time_and_size(tmp_path: Path) -> None:
    log = read_log(path_of("plain-ekf"))
    topic = topics_of(scenario_for("plain-ekf")).estimate
    at_s = -1.0
    with LogWriter(tmp_path / "other.mcap", log.metadata) as other:
        for record in log.records():
            payload = record.payload
            if (record.topic, record.sequence) == (topic, 20):
                message = decode_as(payload, LeaderEstimate)
                payload = encode(dataclasses.replace(message, rho=message.rho + 0.01))
                at_s = (record.log_ns - (log.start_ns or 0)) * 1e-9
            other.write(record.topic, record.typename, payload, record.log_ns, record.publish_ns)
    changed = read_log(tmp_path / "other.mcap")
    for exactly in (True, False):
        *others, line = replayed(changed, exactly=exactly)
        assert re.fullmatch(rf"{topic}: 1 of \d+ differ, first at {at_s:.3f} s, by at most 0\.01", line)
        # The command that rests on it cannot be repeated: what it consumed is not in the log any more.
        assert all("follower/command: 1 of " in other for other in others)


def test_renewing_tells_what_differs_and_keeps_the_new_logs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(reference_logs, "FOLDER", tmp_path / "kept")
    monkeypatch.setattr(reference_logs, "WRITTEN_ON", tmp_path / "kept" / "reference.json")
    said = []
    for seed in (1, 1, 2):
        short = ("run.duration_s=0.5", "run.evaluate_from_s=0.1", f"run.seed={seed}")
        monkeypatch.setattr(reference_logs, "FLIGHTS", {"short": ("turtlebot3", short)})
        renew()
        said.append(capsys.readouterr().out.splitlines())
    assert said[:2] == [["short: new"], ["short: the same"]]
    assert any(re.match(r"short: truth: \d+ of \d+ differ, first at ", line) for line in said[2])
    kept = scenario_of(read_log(tmp_path / "kept" / "short.mcap"))
    assert kept is not None
    assert kept.run.seed == 2
    assert same_hardware()
    assert written_on()["abreast"] == hil.__version__
