"""Chunks that claim more than there is, or would be more than any log needs."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Schema
from mcap.stream_reader import breakup_chunk

from hil.command_line import main
from hil.log.chunk_unpacking import LARGEST_CHUNK_BYTES, chunk_records, packed_records
from hil.log.mcap_chunks import MAGIC


def chunk(compression: str, packed: bytes, size: int, crc: int = 0) -> Chunk:
    return Chunk(
        compression=compression,
        data=packed,
        message_start_time=1,
        message_end_time=2,
        uncompressed_crc=crc,
        uncompressed_size=size,
    )


def bomb(size: int, told: int | None = None, *, sized: bool = True) -> Chunk:
    """Zeros, packed well; ``sized``: the frame says how many."""
    packer = zstandard.ZstdCompressor(level=3, write_content_size=sized).compressobj(size if sized else -1)
    piece = bytes(1 << 20)
    packed = b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()
    return chunk("zstd", packed, size if told is None else told)


def file_of(record: Chunk) -> bytes:
    builder = RecordBuilder()
    for each in (Header(profile="ros2", library="x"), record, DataEnd(data_section_crc=0), Footer(0, 0, 0)):
        each.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return MAGIC + data + MAGIC


@given(st.binary(max_size=300), st.sampled_from(["", "zstd", "lz4"]), st.booleans())
def test_what_was_packed_comes_out(data: bytes, compression: str, summed: bool) -> None:
    pack = {"": bytes, "zstd": zstandard.compress, "lz4": lz4.frame.compress}
    packed = chunk(compression, pack[compression](data), len(data), zlib.crc32(data) * summed)
    assert chunk_records(packed) == data
    for size in (len(data) + 1, len(data) - 1):
        if size >= 0:
            with pytest.raises((ValueError, zstandard.ZstdError, RuntimeError)):
                chunk_records(chunk(compression, pack[compression](data), size))


@pytest.mark.parametrize(
    "record",
    [
        bomb(LARGEST_CHUNK_BYTES + (1 << 20)),
        bomb(64 << 20),
        bomb(64 << 20, told=1000),
        bomb(64 << 20, told=1000, sized=False),
        chunk("lz4", lz4.frame.compress(bytes(64 << 20)), 1000),
        chunk("zstd", b"", 2**63),
        chunk("snappy", b"abc", 3),
    ],
    ids=["huge", "tight", "more than told", "unsized", "lz4", "absurd", "unknown"],
)
def test_a_bomb_does_not_go_off(record: Chunk, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(file_of(record))
    tracemalloc.start()
    try:
        with pytest.raises((ValueError, zstandard.ZstdError)):
            chunk_records(record)
        for arguments in (["replay", str(path)], ["recover", str(path), "--out", str(tmp_path / "y.mcap")]):
            with pytest.raises(SystemExit) as ended:
                main(arguments)
            assert ended.value.code == 2
            assert capsys.readouterr().err.count("\n") == 1
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def test_a_compressed_file_is_unpacked_as_far_as_a_log_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bomb.mcap.zstd"
    path.write_bytes(bomb(1 << 30).data)
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(path)])
    assert ended.value.code == 2
    assert "as no log's do" in capsys.readouterr().err


def test_records_of_a_chunk_are_those_that_the_mcap_package_finds() -> None:
    builder = RecordBuilder()
    schema = Schema(id=1, name="x/msg/Y", encoding="ros2msg", data=b"int8 z")
    schema.write(builder)
    Channel(id=1, topic="t", message_encoding="cdr", metadata={}, schema_id=1).write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    kinds = [opcode for opcode, _, _ in packed_records(data)]
    assert kinds == [3, 4]
    assert breakup_chunk(chunk("", data, len(data)))[0] == schema
    for broken in (data[:-1], data + b"\x05", data + struct.pack("<BQ", 5, 1), bytes(20)):
        with pytest.raises(ValueError, match="record"):
            list(packed_records(broken))
