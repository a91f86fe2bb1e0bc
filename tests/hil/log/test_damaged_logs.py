"""Damage in the midst of a log costs what it lies in, and is counted and placed."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from hil.errors import UsageError
from hil.log.opened import opened_log
from hil.log.recovery import Recovery, recover
from hil.log.writer import LogWriter
from hil.wire.message_types import RangeBearing
from hil.wire.messages import encode, header

START_NS = 1_700_000_000_000_000_000
PERIOD_NS, COUNT = 4_000_000, 300


def written(path: Path) -> Path:
    with LogWriter(path, {"abreast": {"seed": "7"}}, flush_every_s=0.1) as log:
        for number in range(COUNT):
            at = START_NS + number * PERIOD_NS
            payload = encode(RangeBearing(header(at, "base"), float(number), 1.5))
            log.write("a" if number % 3 else "b", RangeBearing.__msgtype__, payload, at, at)
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return written(tmp_path_factory.mktemp("whole") / "run.mcap").read_bytes()


@pytest.fixture(scope="module")
def chunks(whole: bytes, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, int, int, int]]:
    """Begin, end, first and last message number of each chunk."""
    path = tmp_path_factory.mktemp("chunks") / "run.mcap"
    path.write_bytes(whole)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return [
        (
            each.chunk_start_offset,
            each.chunk_start_offset + each.chunk_length,
            (each.message_start_time - START_NS) // PERIOD_NS,
            (each.message_end_time - START_NS) // PERIOD_NS,
        )
        for each in summary.chunk_indexes
    ]


def recovered(content: bytes) -> tuple[Recovery, list[int]]:
    """What came of a recovery, and the numbers of the messages that were kept."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "bad.mcap", Path(folder) / "good.mcap"
        source.write_bytes(content)
        done = recover(source, target)
        numbers = [(r.log_ns - START_NS) // PERIOD_NS for r in opened_log(target).records()]
        return done, numbers


def expected(chunks: list[tuple[int, int, int, int]], first: int, last: int) -> list[int]:
    """Numbers of the messages in chunks that bytes from ``first`` to before ``last`` do not touch."""
    return [
        number
        for begin, end, low, high in chunks
        if end <= first or begin >= last
        for number in range(low, high + 1)
    ]


@settings(max_examples=40, deadline=None)
@given(data=st.data(), size=st.integers(1, 4000), summary=st.booleans())
def test_what_is_zeroed_costs_the_chunks_it_lies_in(
    whole: bytes, chunks: list[tuple[int, int, int, int]], data: st.DataObject, size: int, summary: bool
) -> None:
    # Behind the first chunk, as nothing but a summary tells again of the channels that this one introduces.
    low = chunks[0][0] if summary else chunks[1][0]
    first = data.draw(st.integers(low, chunks[-1][1] - 1))
    last = min(first + size, chunks[-1][1])
    content = bytearray(whole if summary else whole[: chunks[-1][1]])
    content[first:last] = bytes(last - first)
    done, numbers = recovered(bytes(content))
    touched = content != whole[: len(content)]
    kept = expected(chunks, first, last)
    if not touched:
        kept = list(range(COUNT))
    missing = sorted(set(kept) - set(numbers))
    assert not missing
    assert done.messages == len(numbers)
    if summary:
        assert done.lost == COUNT - len(numbers)
        gone = sorted(set(range(COUNT)) - set(numbers))
        spans = [((g.from_ns - START_NS) // PERIOD_NS, (g.to_ns - START_NS) // PERIOD_NS) for g in done.gaps]
        assert all(any(a <= number <= b for a, b in spans) for number in gone)
        assert done.damaged == bool(gone or done.lost_bytes)


def test_a_flipped_bit_in_the_first_chunk_costs_that_chunk_alone(
    whole: bytes, chunks: list[tuple[int, int, int, int]]
) -> None:
    begin, end, _, last = chunks[0]
    content = bytearray(whole)
    content[(begin + end) // 2] ^= 4
    done, numbers = recovered(bytes(content))
    assert numbers == list(range(last + 1, COUNT))
    assert (done.lost, done.damaged) == (last + 1, True)
    ((begun_s, ended_s),) = done.gaps_s()
    assert begun_s == 0.0
    assert ended_s == pytest.approx(last * PERIOD_NS * 1e-9)


@pytest.mark.parametrize("summary", [True, False])
@pytest.mark.parametrize("bit", [0, 6, 8, 12, 15, 20, 33, 60])
def test_a_damaged_length_costs_nothing_where_the_lengths_in_the_chunk_are_whole(
    whole: bytes, chunks: list[tuple[int, int, int, int]], summary: bool, bit: int
) -> None:
    begin = chunks[4][0]
    content = bytearray(whole if summary else whole[: chunks[-1][1]])
    content[begin + 1 + bit // 8] ^= 1 << bit % 8
    done, numbers = recovered(bytes(content))
    assert numbers == list(range(COUNT))
    assert (done.complete, done.damaged, done.gaps) == (summary, False, ())
    assert done.lost == (0 if summary else None)


def test_indexes_count_what_is_gone_where_no_summary_does(
    whole: bytes, chunks: list[tuple[int, int, int, int]]
) -> None:
    begin, end, low, high = chunks[3]
    content = bytearray(whole)
    content[(begin + end) // 2] ^= 4
    # A footer that says that there is no summary.
    content[-28:-12] = bytes(16)
    done, numbers = recovered(bytes(content))
    assert len(numbers) == COUNT - (high - low + 1)
    assert done.lost == high - low + 1


@pytest.mark.parametrize("zeroed", [True, False])
def test_a_damaged_log_opens_without_what_is_gone(
    whole: bytes, chunks: list[tuple[int, int, int, int]], zeroed: bool, tmp_path: Path
) -> None:
    begin, end, low, high = chunks[5]
    content = bytearray(whole)
    content[begin:end] = bytes(end - begin)
    if not zeroed:
        content = bytearray(whole)
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    log = opened_log(path)
    assert (f"{high - low + 1} messages are gone" in log.damage) == zeroed
    assert log.path == path
    assert len(list(log.records())) == COUNT - zeroed * (high - low + 1)


def test_a_log_of_which_nothing_is_left_is_refused(
    whole: bytes, chunks: list[tuple[int, int, int, int]], tmp_path: Path
) -> None:
    content = bytearray(whole)
    content[chunks[0][0] : chunks[-1][1]] = bytes(chunks[-1][1] - chunks[0][0])
    (tmp_path / "run.mcap").write_bytes(content)
    with pytest.raises(UsageError, match="no message can be read"):
        opened_log(tmp_path / "run.mcap")
