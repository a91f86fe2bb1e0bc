"""The recorder and its disk; time is handed to it."""

from __future__ import annotations

import itertools
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.errors import CheckFailedError, UsageError
from hil.live.disk_watch import LEAST_BYTES, SCARCE_BYTES
from hil.live.recorder import Recorder
from hil.log.opened import opened_log
from hil.log.reader import read_log
from hil.log.rotating_log import pieces_of
from hil.nodes.findings import findings_in
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.events import OVERSIZED, Event
from hil.wire.message_types import DiagnosticArray, Malformed, String
from hil.wire.messages import MalformedPayloadError, decode, decode_as, encode
from tests.hil.small_disk import small_disk

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


class Tape:
    """A recorder that hears a text each 10 ms, and what it reported last."""

    def __init__(self, path: Path, *overrides: str) -> None:
        self.scenario = load_scenario("turtlebot3", overrides)
        self.recorder = Recorder(self.scenario, path)
        self.now_ns = START_NS
        self.recorder.begin(self.now_ns)
        self.heard = 0

    def hear(self, payload: bytes, topic: str = topics.STOP) -> None:
        self.now_ns += 10 * MS
        self.heard += 1
        for message in self.recorder.take(Event(topic, payload), self.now_ns):
            self.said = decode_as(message.payload, DiagnosticArray)

    def run(self, seconds: float, size: int = 50) -> None:
        for _ in range(round(seconds * 100)):
            self.hear(encode(String(data=os.urandom(size // 2).hex())))

    def values(self) -> dict[str, str]:
        return {entry.key: entry.value for entry in self.said.status[0].values}

    def found(self) -> str:
        return findings_in(self.said)["recorder"].get("disk", "")


@contextmanager
def recording(path: Path, *overrides: str) -> Iterator[Tape]:
    tape = Tape(path, *overrides)
    try:
        yield tape
    finally:
        tape.recorder.close()


def test_what_is_oversized_is_counted_by_its_topic_and_dropped(tmp_path: Path) -> None:
    with recording(tmp_path / "run.mcap") as tape:
        for _ in range(3):
            tape.hear(OVERSIZED, "rigid_bodies")
        tape.run(1.0)
        assert tape.values()["oversized.rigid_bodies"] == "3"
        assert "malformed.rigid_bodies" not in tape.values()
        tape.recorder.end(tape.now_ns)
    # What nodes took in, and name in their receipts, is there to be found.
    log = read_log(tmp_path / "run.mcap")
    kept = [log.decode(record) for record in log.records([topics.MALFORMED])]
    assert [each.payload.tobytes() for each in kept if isinstance(each, Malformed)] == [OVERSIZED] * 3
    for typename in topics.types_of(tape.scenario).values():
        with pytest.raises(MalformedPayloadError):
            decode(OVERSIZED, typename)


@pytest.mark.parametrize("deleted", [True, False])
def test_a_log_that_is_taken_away_is_told_at_once(tmp_path: Path, deleted: bool) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    with recording(folder / "run.mcap") as tape:
        tape.run(1.0)
        assert not tape.found()
        assert tape.said.status[0].message == "ok"
        if deleted:
            shutil.rmtree(folder)
        else:
            folder.rename(tmp_path / "elsewhere")
        tape.run(1.0)
        told = f"log {folder / 'run.mcap'} was {'deleted' if deleted else 'moved away'}"
        assert tape.found().startswith(told)
        assert tape.said.status[0].message.startswith(told)
        tape.recorder.end(tape.now_ns)
    if not deleted:
        # And the recorder's own last report, and what the log says of itself.
        assert read_log(tmp_path / "elsewhere" / "run.mcap").messages == tape.heard + 2


def test_a_disk_without_room_is_refused(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", (LEAST_BYTES >> 20) - 1) as folder:
        with pytest.raises(UsageError, match=f"log in {folder}: disk {folder} .* MB free.; expected 17 MB"):
            Recorder(load_scenario("turtlebot3"), folder / "run.mcap")
        assert list(folder.iterdir()) == []


def test_a_disk_that_fills_up_is_told_and_ends_the_log_while_it_is_whole(tmp_path: Path) -> None:
    with (
        small_disk(tmp_path / "disk", (SCARCE_BYTES >> 20) + 2) as folder,
        recording(folder / "run.mcap") as tape,
    ):
        tape.run(1.0)
        assert not tape.found()
        others = bytearray(os.urandom(1 << 20))
        (folder / "others").write_bytes(others * 4)
        tape.run(1.0)
        assert f"disk {folder} (" in tape.found()
        assert tape.said.status[0].message == "ok"
        (folder / "others").write_bytes(others * ((SCARCE_BYTES - LEAST_BYTES >> 20) + 3))
        with pytest.raises(CheckFailedError, match=f"run.mcap: stopped while it is whole, disk {folder}"):
            tape.run(1.0)
        tape.recorder.end(tape.now_ns)
        assert read_log(folder / "run.mcap").messages >= 200


@pytest.mark.parametrize(("key", "pieces"), [("recorder.rotate_s=2", 5), ("recorder.rotate_mb=0.2", 5)])
def test_a_log_in_pieces_is_read_as_one(tmp_path: Path, key: str, pieces: int) -> None:
    with recording(tmp_path / "run.mcap", key) as tape:
        tape.run(9.5, size=2000)
        tape.recorder.end(tape.now_ns)
    folder = tmp_path / "run"
    assert [each.name for each in tmp_path.iterdir()] == ["run"]
    found = pieces_of(folder)
    assert [each.name for each in found] == [f"run_{number}.mcap" for number in range(len(found))]
    assert len(found) >= pieces
    logs = [read_log(each) for each in found]
    for log in logs:
        # Each says how it was made, and when the first of them began.
        assert log.metadata["abreast"] == logs[0].metadata["abreast"]
        assert log.metadata["abreast.log"] == {"begun_ns": str(START_NS + 10 * MS)}
    for earlier, later in itertools.pairwise(logs):
        assert (earlier.end_ns or 0) < (later.start_ns or 0)
    whole = opened_log(folder)
    said = list(whole.records([topics.STOP]))
    assert len(said) == tape.heard
    assert [record.log_ns for record in said] == sorted(record.log_ns for record in said)
    with pytest.raises(UsageError, match="exists already"):
        Recorder(tape.scenario, tmp_path / "run.mcap")
