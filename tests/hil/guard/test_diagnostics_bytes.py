"""Diagnostics written by hand against the general codec."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hil.guard.diagnostics_bytes import diagnostics_bytes
from hil.nodes.node import diagnostics
from hil.wire.messages import encode

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)


@given(
    TEXTS, st.integers(0, 2**31 * 10**9 - 1), TEXTS, st.dictionaries(TEXTS, st.one_of(TEXTS, st.integers()))
)
def test_they_are_the_bytes_of_the_codec(
    name: str, stamp_ns: int, problem: str, values: dict[str, object]
) -> None:
    told = encode(diagnostics(name, stamp_ns, problem, values))
    assert diagnostics_bytes(name, stamp_ns, problem, values) == told
