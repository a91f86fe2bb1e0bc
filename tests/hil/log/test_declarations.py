from __future__ import annotations

from mcap.records import Channel, Schema

from hil.log.declarations import Declarations
from hil.log.mcap_summary import McapSummary
from hil.wire.message_types import OWN_TYPES
from hil.wire.messages import definition, rihs01, typename_of

SCHEMA = Schema(id=1, name="x/msg/Y", encoding="ros2msg", data=b"int8 z")


def channel(number: int, schema_id: int = 1, **metadata: str) -> Channel:
    return Channel(
        id=number, topic=f"t{number}", message_encoding="cdr", metadata=metadata, schema_id=schema_id
    )


def test_the_summary_goes_before_what_is_met_and_that_before_what_comes_later() -> None:
    asked = []

    def elsewhere() -> list[Schema | Channel]:
        asked.append(True)
        return [channel(3), SCHEMA, channel(1, 9)]

    found = Declarations(McapSummary(channels={1: channel(1, 2)}), elsewhere)
    found.hear(channel(1, 5))
    found.hear(channel(2, 7))
    assert found.channel(1) == channel(1, 2)
    assert found.channel(2) == channel(2, 7)
    assert not asked
    assert found.channel(3) == channel(3)
    assert found.channel(4) is None
    assert found.schema_of(channel(3)) == SCHEMA
    assert found.schema_of(channel(3, 8)) is None
    assert found.schema_of(channel(3, 0)) is None
    assert len(asked) == 1
    assert [each.id for each in found.channels()] == [1, 2, 3]


def test_our_own_types_are_known_by_the_hash_beside_the_topic() -> None:
    for kind in OWN_TYPES:
        name = typename_of(kind)
        told = channel(1, 4, topic_type_hash=rihs01(name))
        found = Declarations(McapSummary(), list).schema_of(told)
        assert found == Schema(id=4, name=name, encoding="ros2msg", data=definition(name).encode())
