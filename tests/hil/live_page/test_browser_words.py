from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.live_page.browser_words import Arm, ChangeSide, Hello, Stop, read_post, read_word

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


def test_what_a_browser_says_is_read() -> None:
    assert read_word('{"say":"stop"}') == Stop()
    assert read_word('{"say":"arm","frame":7,"robot":"leader"}') == Arm(7, "leader")
    assert read_word('{"say":"side","frame":7,"side":"left"}') == ChangeSide(7, "left")
    posted = read_post(b'{"token":"t","order":{"say":"stop"}}')
    assert posted is not None
    assert (posted.token, posted.order) == ("t", Stop())


@pytest.mark.parametrize(
    "said",
    [
        "",
        "stop",
        '{"say":"sto"}',
        '{"say":"side","frame":7,"side":"up"}',
        '{"say":"arm","frame":7,"robot":7}',
        '{"say":"arm","robot":"leader"}',
        '{"say":"side","side":"left"}',
        '{"say":"look","follower":-1}',
        '{"say":"seen","frame":1e99}',
        '{"say":"stop","reason":"x"}',
        "[" * 2000,
        '{"say":"arm","frame":7,"robot":"' + "x" * 300 + '"}',
        b"\xff\xfe",
    ],
)
def test_anything_else_is_nothing(said: str | bytes) -> None:
    assert read_word(said) is None


@given(
    JSON | st.fixed_dictionaries({"say": st.sampled_from(["hello", "seen", "look", "arm"]), "token": JSON})
)
def test_no_json_disturbs(value: object) -> None:
    word = read_word(json.dumps(value))
    assert word is None or isinstance(word, Hello | Arm)
    assert read_post(json.dumps(value).encode()) is None


@given(st.binary(max_size=200))
def test_no_bytes_disturb(junk: bytes) -> None:
    assert read_word(junk) is None
    assert read_post(junk) is None


def test_an_order_to_greet_is_none() -> None:
    assert read_post(b'{"token":"t","order":{"say":"hello","token":"t"}}') is None
