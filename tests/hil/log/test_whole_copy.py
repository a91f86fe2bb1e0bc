"""Cuts, flipped bits and ruined chunks, by the hundred: what is whole comes out, and nothing else."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.reader import make_reader

from hil.command_line import main
from hil.errors import UsageError
from hil.log import metadata_sums
from hil.log.described_log import DescribedLog
from hil.log.mcap_chunks import MAGIC
from hil.log.metadata import log_metadata
from hil.log.reader import DamagedLogError, read_log
from hil.log.recovery import recover
from hil.scenario.files import load_scenario
from hil.wire.message_types import RangeBearing, String
from hil.wire.messages import encode, header

START_NS = 1_700_000_000_000_000_000
PERIOD_NS, COUNT = 10_000_000, 320

Message = tuple[str, int, bytes]


class Whole(NamedTuple):
    """A log, its metadata, and of each chunk where it begins and ends and what is in it."""

    content: bytes
    metadata: dict[str, dict[str, str]]
    chunks: list[tuple[int, int, list[Message]]]

    @property
    def messages(self) -> list[Message]:
        return [message for _, _, inside in self.chunks for message in inside]

    def untouched(self, first: int, last: int) -> list[Message]:
        """Messages of the chunks that bytes from ``first`` to before ``last`` are no part of."""
        return [
            message
            for begin, end, inside in self.chunks
            if end <= first or begin >= last
            for message in inside
        ]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    draw = random.Random(1)
    with DescribedLog(path, log_metadata(load_scenario("turtlebot3"), "live"), 0.1) as log:
        for number in range(COUNT):
            at = START_NS + number * PERIOD_NS
            sight = RangeBearing(header(at, "base"), draw.random(), draw.random())
            log.write("a", RangeBearing.__msgtype__, encode(sight), at, at)
            if number % 3 == 0:
                text = String(data="".join(draw.choices("abcdef ", k=60)))
                log.write("b", String.__msgtype__, encode(text), at + 1, at)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    found = [(record.topic, record.log_ns, record.payload) for record in read_log(path).records()]
    chunks = []
    for index in summary.chunk_indexes:
        first_ns, last_ns = index.message_start_time, index.message_end_time
        inside = [message for message in found if first_ns <= message[1] <= last_ns]
        begin = index.chunk_start_offset
        chunks.append((begin, begin + index.chunk_length, inside))
    assert 25 <= len(chunks) <= 50
    metadata = {name: dict(entries) for name, entries in read_log(path).metadata.items()}
    metadata.pop("abreast.log")
    result = Whole(path.read_bytes(), metadata, chunks)
    assert result.messages == found
    return result


def recovered(content: bytes, folder: Path) -> tuple[object, Counter[Message], dict[str, dict[str, str]]]:
    """Exit code of ``abreast recover``, which raises nothing else, and what is in its log."""
    source, target = folder / "bad.mcap", folder / "good.mcap"
    source.write_bytes(content)
    target.unlink(missing_ok=True)
    with pytest.raises(SystemExit) as ended:
        main(["recover", str(source), "--out", str(target)])
    if not target.exists():
        return ended.value.code, Counter(), {}
    log = read_log(target)
    kept = Counter((record.topic, record.log_ns, record.payload) for record in log.records())
    metadata = {name: dict(entries) for name, entries in log.metadata.items() if name != "abreast.log"}
    return ended.value.code, kept, metadata


def check(whole: Whole, bad: bytes, folder: Path, expected: list[Message]) -> object:
    """What is expected is there, and nothing that was not; the exit code, which says whether all is."""
    code, kept, metadata = recovered(bad, folder)
    assert kept <= Counter(whole.messages)
    assert Counter(expected) <= kept
    assert (code == 2) == (not kept)
    if kept:
        assert metadata == whole.metadata
    if kept.total() < len(whole.messages):
        assert code in (1, 2)
    return code


def many(few: int, all_of_them: int) -> list[object]:
    return [few, pytest.param(all_of_them, marks=pytest.mark.slow)]


@pytest.mark.parametrize("count", many(60, 1000))
def test_cuts_cost_what_comes_after_them(whole: Whole, tmp_path: Path, count: int) -> None:
    for length in random.Random(count).sample(range(len(whole.content)), count):
        code = check(whole, whole.content[:length], tmp_path, whole.untouched(length, len(whole.content)))
        if length <= whole.chunks[-1][1]:
            assert code in (1, 2)


@pytest.mark.parametrize("count", many(80, 1000))
def test_flipped_bits_cost_the_chunk_that_they_lie_in(whole: Whole, tmp_path: Path, count: int) -> None:
    draw = random.Random(count)
    for at in draw.sample(range(len(whole.content)), count):
        bad = bytearray(whole.content)
        bad[at] ^= 1 << draw.randrange(8)
        code = check(whole, bytes(bad), tmp_path, whole.untouched(at, at + 1))
        if not any(begin <= at < end for begin, end, _ in whole.chunks):
            assert code == 0


@pytest.mark.parametrize("summary", [True, False])
@pytest.mark.parametrize("count", many(20, 200))
def test_ruined_chunks_cost_themselves(whole: Whole, tmp_path: Path, count: int, summary: bool) -> None:
    draw = random.Random(count)
    content = whole.content if summary else whole.content[: whole.chunks[-1][1]]
    for _ in range(count):
        begin, end, _ = draw.choice(whole.chunks)
        first = draw.randrange(begin, end)
        last = draw.randint(first + 1, end)
        bad = bytearray(content)
        bad[first:last] = draw.randbytes(last - first)
        code = check(whole, bytes(bad), tmp_path, whole.untouched(first, last))
        # Lengths and times in the head of a chunk are told elsewhere too.
        assert code == 1 or (summary and code == 0)


@pytest.mark.parametrize("count", many(20, 200))
def test_a_log_that_lost_its_first_chunks_is_known_by_what_is_told_again(
    whole: Whole, tmp_path: Path, count: int
) -> None:
    """Without a summary nothing else tells of topics and types."""
    draw = random.Random(count)
    content = bytearray(whole.content[: whole.chunks[-1][1]])
    for _ in range(count):
        _, until, _ = whole.chunks[draw.randrange(12)]
        bad = bytearray(content)
        bad[whole.chunks[0][0] : until] = draw.randbytes(until - whole.chunks[0][0])
        assert check(whole, bytes(bad), tmp_path, whole.untouched(0, until)) == 1


@pytest.mark.parametrize("count", many(60, 1000))
def test_a_scenario_of_which_a_bit_is_flipped_is_refused_and_put_right(
    whole: Whole, tmp_path: Path, count: int
) -> None:
    path = tmp_path / "bad.mcap"
    first = whole.content.index(b"scenario_toml")
    last = whole.content.index(metadata_sums.RECORD.encode()) - 20
    draw = random.Random(count)
    for _ in range(count):
        bad = bytearray(whole.content)
        bad[draw.randrange(first, last)] ^= 1 << draw.randrange(8)
        path.write_bytes(bad)
        with pytest.raises(UsageError, match=r"metadata abreast .* are not what was written") as refused:
            read_log(path)
        assert not isinstance(refused.value, DamagedLogError)
        assert check(whole, bytes(bad), tmp_path, whole.messages) == 0


def test_metadata_that_nothing_tells_again_are_gone_and_said(tmp_path: Path) -> None:
    source, target = tmp_path / "bad.mcap", tmp_path / "good.mcap"
    with DescribedLog(source, {"abreast": {"seed": "7777"}}) as log:
        payload = encode(String(data="x"))
        log._next_ns = START_NS + 1  # as if the description had been in a chunk that is gone
        log.write("b", String.__msgtype__, payload, START_NS, START_NS)
    content = source.read_bytes()
    source.write_bytes(content.replace(b"7777", b"7877", 1))
    done = recover(source, target)
    assert (done.messages, done.complete, done.lost_metadata) == (1, False, ("abreast",))
    assert "metadata abreast are gone" in done.said()
    assert read_log(target).metadata == {}


@pytest.mark.parametrize("content", [b"", MAGIC, bytes(4096), b"hello" * 1000, MAGIC * 600])
@pytest.mark.parametrize("name", ["x.mcap", "x.mcap.zstd", "x.db3", "x.bag"])
def test_garbage_is_refused_in_one_line(
    content: bytes, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    for arguments in (["replay", str(path)], ["recover", str(path), "--out", str(tmp_path / "y.mcap")]):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "Traceback" not in said
