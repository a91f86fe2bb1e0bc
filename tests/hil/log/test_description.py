from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.log.description import ORIGIN, described, description
from hil.wire.message_types import String
from hil.wire.messages import decode_as, encode

RECORDS = st.dictionaries(st.text(), st.dictionaries(st.text(), st.text(), max_size=3), max_size=3)


@given(RECORDS, st.integers(0, 2**63 - 1))
def test_what_is_described_is_read_again(metadata: dict[str, dict[str, str]], begun_ns: int) -> None:
    assert described([description(metadata, begun_ns)]) == {**metadata, ORIGIN: {"begun_ns": str(begun_ns)}}


def test_a_description_is_json_that_other_tools_can_read() -> None:
    text = decode_as(description({"abreast": {"seed": "7"}}, 5), String).data
    assert json.loads(text) == {"abreast": {"seed": "7"}, "abreast.log": {"begun_ns": "5"}}


def test_what_is_said_later_comes_on_top() -> None:
    told = [description({"a": {"k": "1"}}, 3), description({"a": {"k": "2"}, "b": {}}, 3)]
    assert described(told) == {"a": {"k": "2"}, "b": {}, ORIGIN: {"begun_ns": "3"}}


@pytest.mark.parametrize("data", ["", "no JSON", "[1]", '{"a": "text"}', '{"a": {"k": 1}}', '{"a": null}'])
def test_what_others_say_there_is_passed_over(data: str) -> None:
    assert described([encode(String(data=data)), b"", b"\0\1\0\0"]) == {}
