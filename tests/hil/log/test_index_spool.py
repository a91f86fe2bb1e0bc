"""What waits on the disk for a log's end."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from hil.log.index_spool import IndexSpool
from hil.log.mcap_chunks import ChunkedMcap


@given(st.lists(st.binary(max_size=50_000) | st.just(bytes(range(256)) * 5000), max_size=20), st.booleans())
def test_it_gives_back_what_it_was_given_and_leaves_no_file(
    tmp_path_factory: pytest.TempPathFactory, pieces: list[bytes], on_disk: bool
) -> None:
    folder = tmp_path_factory.mktemp("spool")
    spool = IndexSpool(folder if on_disk else None)
    for piece in pieces:
        spool.add(piece)
    assert spool.size() == sum(map(len, pieces))
    assert b"".join(spool.blocks()) == b"".join(pieces)
    assert not spool.lost
    assert list(folder.iterdir()) == []
    spool.close()
    spool.add(b"more")
    assert spool.size() == 0


def test_a_folder_that_is_not_there_and_a_disk_that_is_full_lose_it() -> None:
    assert IndexSpool(Path("/no/such/folder")).lost
    spool = IndexSpool()
    spool._file = open("/dev/full", "wb", buffering=100)  # noqa: SIM115
    spool.add(bytes(50))
    assert not spool.lost
    spool.add(bytes(200))
    assert spool.lost
    spool.close()
    assert spool.size() == 0


def test_a_log_without_its_indexes_ends_without_a_summary_and_can_be_read() -> None:
    whole = bytearray()
    log = ChunkedMcap(whole.extend, "ros2", "test", Path("/no/such/folder"))
    channel = log.add_channel("t", log.add_schema("s", "ros2msg", b""), "cdr", {})
    for number in range(3):
        log.add_message(channel, number, number, b"%d" % number)
        log.close_chunk()
    log.finish()
    log.close()
    assert bytes(whole).endswith(ChunkedMcap.bare_end())
    found = [message.data for _, _, message in make_reader(io.BytesIO(bytes(whole))).iter_messages()]
    assert found == [b"0", b"1", b"2"]
