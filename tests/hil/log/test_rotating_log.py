from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.log.opened import opened_log
from hil.log.rotating_log import RotatingLog, log_place, pieces_of
from hil.scenario.lab import RecorderSection
from hil.wire.message_types import String
from hil.wire.messages import encode

START_NS = 1_700_000_000_000_000_000


def write(path: Path, recorder: RecorderSection, seconds: int) -> RotatingLog:
    log = RotatingLog(path, {"abreast": {"seed": "7"}}, recorder)
    for number in range(seconds * 10):
        at = START_NS + number * 100_000_000
        log.write("a", String.__msgtype__, encode(String(data=str(number))), at, at)
        if number == 15:
            log.add_metadata({"later": {"k": "v"}})
    log.close()
    return log


def test_without_rotation_there_is_one_file(tmp_path: Path) -> None:
    path, never = tmp_path / "run.mcap", RecorderSection()
    log = write(path, never, 3)
    assert log_place(path, never) == path
    assert pieces_of(path) == [path]
    assert opened_log(path).messages == log.messages == 32
    assert pieces_of(tmp_path / "missing.mcap") == []


def test_twelve_pieces_are_in_their_order(tmp_path: Path) -> None:
    path, each_second = tmp_path / "run.mcap", RecorderSection(rotate_s=1.0)
    log = write(path, each_second, 12)
    place = log_place(path, each_second)
    (place / "run_x.mcap.cut").write_bytes(b"")
    assert [each.name for each in pieces_of(place)] == [f"run_{number}.mcap" for number in range(12)]
    whole = opened_log(place)
    # Each piece says once how it was made, and one again as metadata were added.
    assert whole.messages == log.messages == 120 + 12 + 1
    told = [whole.decode(record) for record in whole.records(["a"])]
    assert [text.data for text in told if isinstance(text, String)] == [str(number) for number in range(120)]
    first, *others = (opened_log(each) for each in pieces_of(place))
    assert all(each.metadata["later"] == {"k": "v"} for each in others)
    assert all(each.metadata["abreast.log"] == first.metadata["abreast.log"] for each in others)


def test_a_place_that_is_taken_or_cannot_be_made_is_refused(tmp_path: Path) -> None:
    rotating = RecorderSection(rotate_mb=1.0)
    (tmp_path / "run").mkdir()
    with pytest.raises(UsageError, match="run: exists already"):
        RotatingLog(tmp_path / "run.mcap", {}, rotating)
    with pytest.raises(UsageError, match="cannot be made"):
        RotatingLog(tmp_path / "missing" / "run.mcap", {}, rotating)
