from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hil.log.metadata_sums import RECORD, changed, sums_of

entries = st.dictionaries(st.text(max_size=5), st.text(max_size=20), max_size=4)
records = st.dictionaries(st.text(max_size=5).filter(lambda name: name != RECORD), entries, max_size=4)


@given(records, records)
def test_what_has_changed_is_named(
    written: dict[str, dict[str, str]], read: dict[str, dict[str, str]]
) -> None:
    sums = sums_of(written)
    assert sums.keys() == written.keys()
    assert changed(written, sums) == []
    assert changed(read, sums) == [name for name in written if read.get(name) != written[name]]


@given(entries)
def test_the_order_of_entries_is_no_matter(one: dict[str, str]) -> None:
    other = dict(reversed(one.items()))
    assert sums_of({"a": one, RECORD: {}}) == sums_of({"a": other})
