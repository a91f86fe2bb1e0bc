from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import SeekingReader
from mcap.writer import IndexType, Writer

from hil.log.reader import read_log


@pytest.mark.parametrize("spread", [0, 3, 200])
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.CHUNK])
def test_messages_come_as_the_mcap_package_has_them(tmp_path: Path, spread: int, index: IndexType) -> None:
    """Chunks that overlap, times that repeat, an index or none: an independent reader gives the same."""
    path, generator = tmp_path / "x.mcap", np.random.default_rng(5)
    with path.open("wb") as stream:
        writer: Any = Writer(stream, chunk_size=400, index_types=index)
        writer.start()
        schema = writer.register_schema("some_msgs/msg/Thing", "ros2msg", b"int32 x")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("a", "b", "c")]
        for number in range(300):
            when = 1000 + number // 2 + int(generator.integers(0, spread + 1))
            channel = channels[0 if number < 200 else int(generator.integers(0, 3))]
            writer.add_message(
                channel, when, generator.bytes(int(generator.integers(0, 30))), 7 * when, number
            )
        writer.finish()
    log = read_log(path)
    for topics in (None, ["a"], ["b", "c"], ["nothing"], []):
        for start_ns, end_ns in ((None, None), (1050, 1120), (1149, None), (None, 1001)):
            with path.open("rb") as stream:
                wanted = [
                    (channel.topic, message.data, message.log_time, message.publish_time, message.sequence)
                    for _, channel, message in SeekingReader(stream).iter_messages(
                        topics=topics, starting_at=start_ns, ending_before=end_ns
                    )
                ]
            found = [
                (each.topic, each.payload, each.log_ns, each.publish_ns, each.sequence)
                for each in log.records(topics, start_ns, end_ns)
            ]
            assert found == wanted
